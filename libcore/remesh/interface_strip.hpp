#pragma once

/// What a parallel remesh left undone lies along the former interfaces: where that is.

#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Distance of nodes from the marked ones, counted in elements: 0 at them, at most `layers`; layers + 1 beyond. Alike
/// on all holders of a node. marks: [node], alike or not. Collective.
std::vector<int> layers_from(const Communicator& comm, const Mesh& mesh, const std::vector<std::uint8_t>& marks,
                             int layers);

}  // namespace malleus
