#pragma once

/// Pockets too small for the mesh, which a front leaves behind on a wall.

#include <span>

#include "mesh/mesh.hpp"
#include "mesh/node_regions.hpp"

namespace malleus {

/// Largest number of nodes of a pocket that the mesh cannot resolve: a node and its neighbours in a regular mesh.
constexpr int unresolved_nodes(int dim) {
  return dim == 2 ? 7 : 15;
}

/// Regions of nodes of level set <= 0 that hang together through elements. level_set: [node] m. Collective.
NodeRegions regions_outside(const Communicator& comm, const Mesh& mesh, std::span<const Real> level_set);

/// Makes the level set positive in each region of nodes of level set <= 0 that hangs together through elements, has
/// at most unresolved_nodes() nodes, and has none that is marked open (where the outside can flow in or out). Along
/// walls without slip a front cuts off such pockets, an element or two large; they would never leave, carry no load,
/// and lower the pressure of a filling (measured: 8 % in a channel of 16 elements). A filled node takes the largest
/// value of its neighbours, at least what it had with the other sign. The volume has to be restored afterwards.
/// open: [node], alike on all holders. Returns the number of pockets filled. Collective.
int fill_unresolved_pockets(const Communicator& comm, const Mesh& mesh, std::span<const char> open,
                            std::span<Real> level_set);

}  // namespace malleus
