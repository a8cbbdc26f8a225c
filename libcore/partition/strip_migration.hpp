#pragma once

/// The paper's repartitioning as it stands there (section 3.1.4): pairs of processors by friendship, and strips of
/// equal distance from their interface that go from one to the other while the cost of the pair falls.

#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

struct StripOptions {
  int most_iterations = 200;
  int most_strips = 64;    ///< of a part that are looked at
  Real edge_cost = 0;      ///< time of a cut edge of the graph at bandwidth 1, in weights per speed
  Real least_gain = 1e-6;  ///< of a pair, as a share of the mean time; below it is left alone
};

struct StripReport {
  int iterations = 0;
  GlobalId pairs = 0;  ///< that exchanged strips, over all iterations
};

/// Improves parts [owned vertex]. In each iteration F(p,q) = max(t_p, t_q) + C(p,q) is evaluated strip by strip for all
/// neighbouring p and q (eq. 16), friendship is the largest gain of a pair (eq. 17), pairs are formed by decreasing
/// friendship, each processor in one at most, and all pairs move their best strips at once. Ends when no pair gains.
/// Where a strip touches third processors the change of those links counts too. Collective.
std::vector<int> migrate_strips(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                std::vector<int> parts, const StripOptions& options, StripReport& report);

}  // namespace malleus
