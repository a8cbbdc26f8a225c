#pragma once

/// Integrals over boundary facets.

#include <numbers>

#include "mesh/simplex.hpp"

namespace malleus {

/// What the integrals weigh with: nothing (3D; 2D: plane strain, per metre of depth) or 2 pi x (2D, axis x = 0).
enum class Geometry { plane, axisymmetric };

/// A facet's outward unit normal and the matrix of integrals of phi_a phi_b over it [m^2; m in plane strain].
template <int D>
struct FacetIntegrals {
  Point<D> normal;
  Eigen::Matrix<Real, D, D> mass;

  Real area() const { return mass.sum(); }
  /// Integral of each phi_a.
  Eigen::Matrix<Real, D, 1> shares() const { return mass.rowwise().sum(); }
};

/// Normal times area of a facet, out of its element [m^2; m in 2D].
template <int D>
Point<D> facet_area_normal(const Eigen::Matrix<Real, D, D>& points) {
  const Point<D> edge = points.col(1) - points.col(0);
  if constexpr (D == 2) {
    return {edge[1], -edge[0]};
  } else {
    return 0.5 * edge.cross(Point<3>(points.col(2) - points.col(0)));
  }
}

template <int D>
Eigen::Matrix<Real, D, D> facet_points(const Mesh& mesh, LocalId facet) {
  Eigen::Matrix<Real, D, D> points;
  const auto nodes = mesh.nodes_of_facet(facet);
  for (int i = 0; i < D; ++i)
    points.col(i) = Eigen::Map<const Point<D>>(mesh.point(nodes[static_cast<std::size_t>(i)]));
  return points;
}

/// The facet must not be degenerate.
template <int D>
FacetIntegrals<D> facet_integrals(const Mesh& mesh, LocalId facet, Geometry geometry) {
  const Eigen::Matrix<Real, D, D> points = facet_points<D>(mesh, facet);
  const Point<D> area_normal = facet_area_normal<D>(points);
  const Real area = area_normal.norm();
  FacetIntegrals<D> result;
  result.normal = area_normal / area;
  if (geometry == Geometry::axisymmetric) {
    if constexpr (D == 2) {
      const Real r0 = points(0, 0);
      const Real r1 = points(0, 1);
      result.mass << 3 * r0 + r1, r0 + r1, r0 + r1, r0 + 3 * r1;
      result.mass *= 2 * std::numbers::pi * area / 12;
    }
    return result;
  }
  result.mass.setConstant(area / (D * (D + 1)));
  result.mass.diagonal() *= 2;
  return result;
}

}  // namespace malleus
