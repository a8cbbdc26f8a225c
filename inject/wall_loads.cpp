#include "inject/wall_loads.hpp"

#include <algorithm>

namespace malleus::inject {
namespace {

/// Tangential part of the viscous stress on a facet.
template <int D>
Real shear_on(const Scene& scene, LocalId facet, const Point<D>& normal) {
  const LocalId e = scene.mesh.facet_element[static_cast<std::size_t>(facet)];
  const auto shape = p1_gradients<D>(simplex_points<D>(scene.mesh, e));
  const std::span<const Real> velocity = scene.fields["velocity"].values();
  Eigen::Matrix<Real, D, D + 1> nodal;
  const auto nodes = scene.mesh.nodes_of_element(e);
  for (int a = 0; a <= D; ++a) {
    const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]);
    nodal.col(a) = Eigen::Map<const Point<D>>(velocity.data() + node * D);
  }
  const Eigen::Matrix<Real, D, D> gradient = nodal * shape.gradients.transpose();
  const Point<D> traction =
      scene.fields["viscosity"].values()[static_cast<std::size_t>(e)] * ((gradient + gradient.transpose()) * normal);
  return (traction - normal.dot(traction) * normal).norm();
}

}  // namespace

std::vector<Real> wall_shear_stress(const Scene& scene) {
  const auto n = static_cast<std::size_t>(scene.mesh.nodes());
  std::vector<Real> sums(2 * n, 0);  // stress times area, area
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::wall)) {
      for (const LocalId facet : part->facets) {
        const Point<D> area_normal = facet_area_normal<D>(facet_points<D>(scene.mesh, facet));
        const Real area = area_normal.norm();
        const Real stress = shear_on<D>(scene, facet, area_normal / area);
        for (const LocalId node : scene.mesh.nodes_of_facet(facet)) {
          sums[2 * static_cast<std::size_t>(node)] += stress * area;
          sums[2 * static_cast<std::size_t>(node) + 1] += area;
        }
      }
    }
  });
  scene.mesh.node_halo.add_to_owners(sums, 2);
  scene.mesh.node_halo.update_copies(sums, 2);
  std::vector<Real> stress(n, 0);
  for (std::size_t node = 0; node < n; ++node) {
    if (sums[2 * node + 1] > 0) stress[node] = sums[2 * node] / sums[2 * node + 1];
  }
  return stress;
}

std::array<Real, 3> opening_force(const Scene& scene) {
  const std::span<const Real> pressure = scene.fields["pressure"].values();
  std::array<Real, 3> force = {0, 0, 0};
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::wall)) {
      for (const LocalId facet : part->facets) {
        const FacetIntegrals<D> integrals = facet_integrals<D>(scene.mesh, facet, scene.geometry);
        const auto shares = integrals.shares();
        Real push = 0;
        for (int i = 0; i < D; ++i) {
          const auto node = static_cast<std::size_t>(scene.mesh.nodes_of_facet(facet)[static_cast<std::size_t>(i)]);
          push += shares[i] * std::max(0.0, pressure[node]);
        }
        for (int c = 0; c < D; ++c) force[static_cast<std::size_t>(c)] += push * std::max(0.0, integrals.normal[c]);
      }
    }
  });
  scene.comm.sum_in_place(force);
  return force;
}

}  // namespace malleus::inject
