#pragma once

/// Functions of packed symmetric tensors through their eigenvalues.

#include <utility>

#include "remesh/geometry.hpp"

namespace malleus::remeshing {

/// One Jacobi rotation that makes a[p][q] zero; rows of `vectors` turn along. False where it was zero to round-off.
template <int D>
bool rotate_away(std::array<Point<D>, D>& a, std::array<Point<D>, D>& vectors, std::size_t p, std::size_t q) {
  const Real off = a[p][q];
  if (!(std::abs(off) > 1e-17 * std::sqrt(std::abs(a[p][p] * a[q][q]))) || std::abs(off) < 1e-290) return false;
  const Real theta = (a[q][q] - a[p][p]) / (2 * off);
  const Real t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::hypot(theta, 1.0));
  const Real c = 1 / std::sqrt(t * t + 1);
  const Real s = t * c;
  for (std::size_t k = 0; k < D; ++k) {
    const Real kp = a[k][p];
    const Real kq = a[k][q];
    a[k][p] = c * kp - s * kq;
    a[k][q] = s * kp + c * kq;
  }
  for (std::size_t k = 0; k < D; ++k) {
    const Real pk = a[p][k];
    const Real qk = a[q][k];
    a[p][k] = c * pk - s * qk;
    a[q][k] = s * pk + c * qk;
    const Real vp = vectors[p][k];
    const Real vq = vectors[q][k];
    vectors[p][k] = c * vp - s * vq;
    vectors[q][k] = s * vp + c * vq;
  }
  return true;
}

template <int D>
struct EigenSystem {
  Point<D> values;                  ///< increasing
  std::array<Point<D>, D> vectors;  ///< orthonormal, one per value
};

/// By Jacobi's rotations, which keep the small eigenvalues of strongly stretched tensors accurate.
template <int D>
EigenSystem<D> eigen_system(const Symmetric<D>& m) {
  std::array<Point<D>, D> a;
  EigenSystem<D> result;
  for (std::size_t i = 0; i < D; ++i) {
    for (std::size_t j = 0; j < D; ++j) {
      a[i][j] = m[packed(static_cast<int>(i), static_cast<int>(j))];
      result.vectors[i][j] = i == j ? 1 : 0;
    }
  }
  for (int sweep = 0; sweep < 30; ++sweep) {
    bool diagonal = true;
    for (std::size_t p = 0; p < D; ++p) {
      for (std::size_t q = p + 1; q < D; ++q) diagonal = !rotate_away<D>(a, result.vectors, p, q) && diagonal;
    }
    if (diagonal) break;
  }
  for (std::size_t i = 0; i < D; ++i) result.values[i] = a[i][i];
  for (std::size_t i = 0; i < D; ++i) {
    for (std::size_t j = i + 1; j < D; ++j) {
      if (result.values[j] >= result.values[i]) continue;
      std::swap(result.values[i], result.values[j]);
      std::swap(result.vectors[i], result.vectors[j]);
    }
  }
  return result;
}

template <int D>
Symmetric<D> compose(const EigenSystem<D>& system) {
  Symmetric<D> m{};
  for (std::size_t k = 0; k < D; ++k) {
    for (int i = 0; i < D; ++i) {
      for (int j = 0; j <= i; ++j) {
        m[packed(i, j)] += system.values[k] * system.vectors[k][static_cast<std::size_t>(i)] *
                           system.vectors[k][static_cast<std::size_t>(j)];
      }
    }
  }
  return m;
}

/// The tensor of same axes whose eigenvalues are function(eigenvalue).
template <int D, class Function>
Symmetric<D> map_eigenvalues(const Symmetric<D>& m, Function&& function) {
  EigenSystem<D> system = eigen_system<D>(m);
  for (Real& value : system.values) value = function(value);
  return compose<D>(system);
}

template <int D>
Symmetric<D> exponential(const Symmetric<D>& m) {
  return map_eigenvalues<D>(m, [](Real value) { return std::exp(value); });
}

/// m must be positive.
template <int D>
Symmetric<D> logarithm(const Symmetric<D>& m) {
  return map_eigenvalues<D>(m, [](Real value) { return std::log(value); });
}

}  // namespace malleus::remeshing
