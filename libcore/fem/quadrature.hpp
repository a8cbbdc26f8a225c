#pragma once

/// Quadrature on the simplex.

#include <Eigen/Dense>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// Points of the inside by barycentric coordinates, and weights that sum to 1 (times the volume).
template <int D>
struct QuadraturePoint {
  Eigen::Matrix<Real, D + 1, 1> barycentric;
  Real weight;
};

/// Conical product of Gauss-Jacobi rules with n points an axis (Stroud 1971): n^D points, exact for polynomials of
/// degree 2n - 1. 1 <= n <= 8.
template <int D>
std::vector<QuadraturePoint<D>> simplex_quadrature(int n);

}  // namespace malleus
