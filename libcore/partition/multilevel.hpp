#pragma once

/// Refinement on ever finer graphs.

#include <functional>
#include <span>
#include <vector>

#include "partition/pair_refiner.hpp"

namespace malleus {

struct MultilevelSettings {
  Real tolerance = 0.01;       ///< imbalance aimed at on the given graph; coarser ones have three times as much
  int vertices_per_part = 40;  ///< at which coarsening ends
  int passes = 1;              ///< over all pairs of parts, and of the search in each of their bands
};

/// A way to divide a graph from scratch.
struct StartMaker {
  /// A part for each owned vertex. Collective on the graph's communicator, which may be of one rank.
  std::function<std::vector<int>(const Communicator&, const WorkGraph&)> make;
  bool is_for_coarsest = false;  ///< goes by edges, not by places: made on the coarsest graph alone
};

struct Divided {
  std::vector<int> parts;  ///< [owned vertex]
  std::size_t start = 0;   ///< the one that it was made from
};

/// Improves parts, one for each owned vertex, towards targets [part]: neighbours of one part and rank are merged level
/// by level; on the coarsest graph the loads are levelled, and on each level back borders are improved. Coarse vertices
/// make large changes cheap. What was done is added to count. Collective.
std::vector<int> refine_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                   std::vector<int> parts, const std::vector<Real>& targets,
                                   const MultilevelSettings& settings, RefinementCount& count);

/// The same without parts: neighbours of one rank are merged, the coarsest graph is divided by each of the starts and
/// refined, and the one that cuts least there is carried on. Collective.
Divided divide_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                          std::span<const StartMaker> starts, const std::vector<Real>& targets,
                          const MultilevelSettings& settings, RefinementCount& count);

}  // namespace malleus
