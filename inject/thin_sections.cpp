#include "inject/thin_sections.hpp"

#include <algorithm>
#include <cmath>

#include "base/log.hpp"
#include "solvers/facet_distance.hpp"

namespace malleus::inject {
namespace {

/// Sections of 4 regular elements measure 3.9 to 4.5 here, those of 3 at most 3.5; those of 2 measure 2.5, of 1 0.5.
constexpr Real four_across = 3.75;
constexpr Real two_across = 1.5;
constexpr Real no_wall = 1e300;

/// Distance of each node from the walls on which fluid stands still [m].
std::vector<Real> wall_distance(const Scene& scene) {
  const auto dim = static_cast<std::size_t>(scene.mesh.dim);
  std::vector<DistanceFacet> facets;
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::wall)) {
    if (scene.settings.walls[part->index].condition != WallSettings::Condition::no_slip) continue;
    for (const LocalId f : part->facets) {
      DistanceFacet facet;
      const auto nodes = scene.mesh.nodes_of_facet(f);
      for (std::size_t i = 0; i < dim; ++i) {
        std::copy_n(scene.mesh.point(nodes[i]), dim, facet.vertices.data() + i * dim);
      }
      for (const LocalId node : nodes) {
        facet.node = node;
        facets.push_back(facet);
      }
    }
  }
  return distance_to_facets(scene.comm, scene.mesh, scene.graph, facets, no_wall);
}

/// Each node takes the largest value of itself and its neighbours.
void spread_largest(const Mesh& mesh, const NodeGraph& graph, std::vector<Real>& values) {
  std::vector<Real> largest = values;
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    for (const LocalId neighbour : graph.of(node)) {
      Real& value = largest[static_cast<std::size_t>(node)];
      value = std::max(value, values[static_cast<std::size_t>(neighbour)]);
    }
  }
  values = std::move(largest);
  mesh.node_halo.max_to_owners(values, 1);
  mesh.node_halo.update_copies(values, 1);
}

}  // namespace

ThinSections find_thin_sections(const Scene& scene) {
  const int dim = scene.mesh.dim;
  std::vector<Real> half_thickness = wall_distance(scene);
  for (int ring = 0; ring < 2; ++ring) spread_largest(scene.mesh, scene.graph, half_thickness);
  std::array<Real, 2> thin = {0, 0};
  for (LocalId e = 0; e < scene.mesh.elements(); ++e) {
    const Real volume = with_dim(dim, [&](auto d) {
      constexpr int D = decltype(d)::value;
      return simplex_volume<D>(simplex_points<D>(scene.mesh, e));
    });
    const Real size = dim == 2 ? std::sqrt(4 / std::sqrt(3.0) * volume) : std::cbrt(6 * std::sqrt(2.0) * volume);
    Real half = 0;
    for (const LocalId node : scene.mesh.nodes_of_element(e)) {
      half = std::max(half, half_thickness[static_cast<std::size_t>(node)]);
    }
    if (half >= no_wall) continue;
    const Real across = 2 * half / size + 0.5;
    if (across < two_across) thin[0] += scene.measures[static_cast<std::size_t>(e)];
    if (across < four_across) thin[1] += scene.measures[static_cast<std::size_t>(e)];
  }
  scene.comm.sum_in_place(thin);
  return {thin[0] / scene.cavity, thin[1] / scene.cavity};
}

void warn_of(const ThinSections& thin) {
  if (thin.below_two > 1e-3) {
    log::warning(
        "{:.3g} % of the cavity is one element thin between walls: nothing flows there, and nothing is claimed for "
        "it; refine the mesh to 4 elements across",
        100 * thin.below_two);
  }
  if (thin.below_four > 1e-2) {
    log::warning(
        "{:.3g} % of the cavity has fewer than 4 elements across: pressure drops there are up to 4 % (3 across) and 15 "
        "% "
        "(2 across) too high, of a power law with n = 0.3 up to 12 % and 39 %",
        100 * thin.below_four);
  }
}

}  // namespace malleus::inject
