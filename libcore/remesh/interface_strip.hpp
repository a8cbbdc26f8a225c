#pragma once

/// What a parallel remesh left undone lies along the former interfaces: where that is.

#include <vector>

#include "mesh/mesh.hpp"
#include "remesh/plane_cuts.hpp"

namespace malleus {

/// Distance of nodes from the marked ones, counted in elements: 0 at them, at most `layers`; layers + 1 beyond. Alike
/// on all holders of a node. marks: [node], alike or not. Collective.
std::vector<int> layers_from(const Mesh& mesh, const std::vector<std::uint8_t>& marks, int layers);

/// The largest of the holders' values at each node, for all of them. Collective.
void level_largest(const Mesh& mesh, std::vector<Real>& values);
void level_largest(const Mesh& mesh, std::vector<std::uint8_t>& values);

/// [element][dim]. Local.
std::vector<Real> centroids(const Mesh& mesh);

/// Elements that planes cut or nearly touch, and so many layers about them: [element] 1 or 0. Collective.
std::vector<std::uint8_t> elements_at(const Mesh& mesh, const PlaneCuts& cuts, int layers);

}  // namespace malleus
