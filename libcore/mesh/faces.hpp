#pragma once

/// Faces of simplices (edges in 2D): matching and neighbours. Everything here is local.

#include <array>
#include <span>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// Local indices of the nodes of face f of a simplex, face f being opposite node f; the normal of the face, by the
/// right-hand rule (in 2D: the edge direction turned by -90 degrees), points out of a positive simplex.
constexpr std::array<std::array<int, 3>, 4> tetrahedron_faces = {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
constexpr std::array<std::array<int, 3>, 3> triangle_faces = {{{1, 2, -1}, {2, 0, -1}, {0, 1, -1}}};

/// Node (0..dim) k = 0..dim-1 of face f of a simplex.
constexpr int face_node(int dim, int face, int k) {
  return dim == 3 ? tetrahedron_faces[static_cast<std::size_t>(face)][static_cast<std::size_t>(k)]
                  : triangle_faces[static_cast<std::size_t>(face)][static_cast<std::size_t>(k)];
}

/// Neighbour across each face. [element][dim+1]: local element, or -1. element_nodes: [element][dim+1], node
/// indices in [0, nodes). A face with more than two elements is an InputError (non-manifold mesh).
std::vector<LocalId> element_neighbours(int dim, LocalId nodes, std::span<const LocalId> element_nodes);

}  // namespace malleus
