#pragma once

/// What a parallel remesh left undone lies along the former interfaces: where that is, and how it comes to lie inside.

#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Distance of nodes from the marked ones, counted in elements: 0 at them, at most `layers`; layers + 1 beyond. Alike
/// on all holders of a node. marks: [node], alike or not. Collective.
std::vector<int> layers_from(const Communicator& comm, const Mesh& mesh, const std::vector<std::uint8_t>& marks,
                             int layers);

/// A rank for each element such that interfaces at marked nodes move away from them: of the ranks that meet at a
/// marked node one, drawn from `round`, takes over the elements up to `layers` around it; where several would, the
/// nearest, then the one drawn first. Other elements stay. Collective.
std::vector<int> move_interfaces(const Communicator& comm, const Mesh& mesh, const std::vector<std::uint8_t>& marks,
                                 int layers, int round);

}  // namespace malleus
