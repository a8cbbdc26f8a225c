#pragma once

/// Normals of a piece of the boundary at its nodes.

#include <span>
#include <vector>

#include "fem/facet.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// For each node of the mesh, whether it lies on the surface, and the directions in which a velocity leaves it.
struct SurfaceNormals {
  int dim = 3;
  /// [node][dim]: integral of phi n over the surface [m^2]. Zero flow through the surface is v . this = 0, summed over
  /// its nodes: the consistent normal. Zero off the surface.
  std::vector<Real> weighted;
  /// [node][dim][dim]: orthonormal rows, the first `count` of which leave the surface. Where the surface is smooth the
  /// consistent normal alone; along an edge sharper than 40 degrees two, at a corner three.
  std::vector<Real> directions;
  std::vector<int> count;  ///< [node] 0 off the surface

  bool is_on(LocalId node) const { return count[static_cast<std::size_t>(node)] > 0; }
  const Real* direction(LocalId node, int k) const {
    return directions.data() + (static_cast<std::size_t>(node) * dim + k) * dim;
  }
};

/// facets: of this rank. Alike on all holders of a node. Collective.
SurfaceNormals surface_normals(const Mesh& mesh, std::span<const LocalId> facets, Geometry geometry);

}  // namespace malleus
