#pragma once

/// Geometry of one simplex: volume, gradients of the P1 functions, quality.

#include <Eigen/Dense>
#include <span>

#include "base/types.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

template <int D>
using Point = Eigen::Matrix<Real, D, 1>;
template <int D>
using SimplexPoints = Eigen::Matrix<Real, D, D + 1>;  ///< a column a vertex, m

/// Points of an element's nodes.
template <int D>
SimplexPoints<D> simplex_points(const Mesh& mesh, LocalId element) {
  SimplexPoints<D> points;
  const auto nodes = mesh.nodes_of_element(element);
  for (int i = 0; i <= D; ++i)
    points.col(i) = Eigen::Map<const Point<D>>(mesh.point(nodes[static_cast<std::size_t>(i)]));
  return points;
}

/// Signed volume [m^3] (area [m^2] in 2D); positive for a right-handed vertex order.
template <int D>
Real simplex_volume(const SimplexPoints<D>& points) {
  const Eigen::Matrix<Real, D, D> edges = points.template rightCols<D>().colwise() - points.col(0);
  return edges.determinant() / (D == 2 ? 2.0 : 6.0);
}

/// Gradients of the D+1 barycentric functions, a column each [1/m], and the signed volume. The simplex must not be
/// flat.
template <int D>
struct P1Gradients {
  Eigen::Matrix<Real, D, D + 1> gradients;
  Real volume;
};
template <int D>
P1Gradients<D> p1_gradients(const SimplexPoints<D>& points) {
  const Eigen::Matrix<Real, D, D> edges = points.template rightCols<D>().colwise() - points.col(0);
  P1Gradients<D> result;
  result.volume = edges.determinant() / (D == 2 ? 2.0 : 6.0);
  result.gradients.template rightCols<D>() = edges.inverse().transpose();
  result.gradients.col(0) = -result.gradients.template rightCols<D>().rowwise().sum();
  return result;
}

/// Shape quality, 1 for the regular simplex, 0 when flat, negative when inverted:
/// 3D 6 sqrt(2) V / l^3, 2D 4 / sqrt(3) A / l^2 with l the root mean square edge length.
template <int D>
Real simplex_quality(const SimplexPoints<D>& points) {
  Real squares = 0;
  for (int i = 0; i <= D; ++i) {
    for (int j = 0; j < i; ++j) squares += (points.col(i) - points.col(j)).squaredNorm();
  }
  const Real mean_square = squares / (D == 2 ? 3.0 : 6.0);
  if (!(mean_square > 0)) return 0;
  const Real volume = simplex_volume<D>(points);
  return D == 2 ? volume * 4.0 / std::sqrt(3.0) / mean_square
                : volume * 6.0 * std::sqrt(2.0) / (mean_square * std::sqrt(mean_square));
}

/// The one door from a run-time dimension to a compile-time one; call it outside element loops.
template <class Function>
decltype(auto) with_dim(int dim, Function&& function) {
  if (dim == 2) return function(std::integral_constant<int, 2>{});
  return function(std::integral_constant<int, 3>{});
}

}  // namespace malleus
