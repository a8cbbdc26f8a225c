#pragma once

/// Moving the borders between parts into what was their inside, so that the next pass of a remesher reaches what it had
/// to leave (paper, section 3.2.2).

#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

/// Who takes over the elements along a border.
enum class ReleaseAim {
  most_released,  ///< of the parts around a node the one drawn highest: corners come free, too, loads are uneven
  equal_loads,    ///< what a part gives and takes cancels; what is left is levelled along borders that avoid the old
  equal_strips,   ///< all parts as much of the strips along the borders: for a pass that works on these alone
};

struct ReleaseOptions {
  ReleaseAim aim = ReleaseAim::equal_loads;
  Real tolerance = 0.03;  ///< with equal_loads: imbalance of the work allowed afterwards
  int layers = 1;         ///< how many elements far borders move
  int round = 0;          ///< another order of the parts in each round, so that corners are freed in turn
};

/// The new parts, and what came out over all ranks.
struct Release {
  std::vector<int> parts;        ///< [element] of this rank
  GlobalId interface_nodes = 0;  ///< nodes to be released
  GlobalId still = 0;            ///< of these, those between parts afterwards
  GlobalId moved_elements = 0;
  Real imbalance = 0;  ///< of the work, afterwards
};

/// A part for each element such that few of the nodes between the present parts lie between the new ones. At each such
/// node one of the parts around takes over the elements up to `layers` around it; where several would, the nearest.
/// work: [element] as the next pass will find it (predicted elements, say); parts: [element] in [0,
/// architecture.parts()); released: [node] 1 at the nodes that matter, or empty for all between parts. Elements far
/// from borders stay. Collective.
Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const Architecture& architecture, std::span<const int> parts,
                               const ReleaseOptions& options, std::span<const std::uint8_t> released = {});

/// The same where each rank is a part: the parts are destinations for migrate(). Collective.
Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const ReleaseOptions& options, std::span<const std::uint8_t> released = {});

}  // namespace malleus
