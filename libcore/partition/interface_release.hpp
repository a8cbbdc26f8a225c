#pragma once

/// Moving the borders between parts into what was their inside, so that the next pass of a remesher reaches what it had
/// to leave (paper, section 3.2.2).

#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

struct ReleaseOptions {
  Real tolerance = 0.03;  ///< imbalance of the work allowed afterwards
  int round = 0;          ///< another order of the parts in each round, so that corners are freed in turn
  bool balanced = true;   ///< false: only the shift by a layer, which moves less and leaves the loads uneven
};

/// The new parts, and what came out over all ranks.
struct Release {
  std::vector<int> parts;        ///< [element] of this rank
  GlobalId interface_nodes = 0;  ///< nodes between parts before
  GlobalId still = 0;            ///< of these, those between parts afterwards
  GlobalId moved_elements = 0;
  Real imbalance = 0;  ///< of the work, afterwards
};

/// A part for each element such that few of the nodes between the present parts lie between the new ones. At each such
/// node one of the parts around takes over the elements around it; then loads are levelled by moves along borders that
/// avoid the old ones. work: [element] as the next pass will find it (predicted elements, say); parts: [element] in
/// [0, architecture.parts()). Elements far from borders stay. Collective.
Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const Architecture& architecture, std::span<const int> parts,
                               const ReleaseOptions& options);

/// The same where each rank is a part: the parts are destinations for migrate(). Collective.
Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const ReleaseOptions& options);

}  // namespace malleus
