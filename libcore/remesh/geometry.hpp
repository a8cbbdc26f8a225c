#pragma once

/// Points, faces and volumes of simplices, as the remesher's inner loops want them: plain arrays, no roots.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/types.hpp"

namespace malleus::remeshing {

template <int D>
using Point = std::array<Real, D>;

/// Symmetric tensors packed in Medit's order: 2D xx, xy, yy; 3D xx, xy, yy, xz, yz, zz.
template <int D>
inline constexpr int symmetric_size = D*(D + 1) / 2;
template <int D>
using Symmetric = std::array<Real, symmetric_size<D>>;

/// Place of entry (i, j) in a packed symmetric tensor.
constexpr std::size_t packed(int i, int j) {
  const int row = i > j ? i : j;
  const int column = i > j ? j : i;
  return static_cast<std::size_t>(row * (row + 1) / 2 + column);
}

template <int D>
Point<D> difference(const Point<D>& a, const Point<D>& b) {
  Point<D> c;
  for (std::size_t i = 0; i < D; ++i) c[i] = a[i] - b[i];
  return c;
}

/// a + t (b - a)
template <int D>
Point<D> between(const Point<D>& a, const Point<D>& b, Real t) {
  Point<D> c;
  for (std::size_t i = 0; i < D; ++i) c[i] = a[i] + t * (b[i] - a[i]);
  return c;
}

/// a + t d
template <int D>
Point<D> shifted(const Point<D>& a, const Point<D>& d, Real t) {
  Point<D> c;
  for (std::size_t i = 0; i < D; ++i) c[i] = a[i] + t * d[i];
  return c;
}

template <std::size_t N>
Real dot(const std::array<Real, N>& a, const std::array<Real, N>& b) {
  Real sum = 0;
  for (std::size_t i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

template <int D>
Real squared_distance(const Point<D>& a, const Point<D>& b) {
  Real sum = 0;
  for (std::size_t i = 0; i < D; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

inline Point<3> cross(const Point<3>& a, const Point<3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// v with unit length; zero stays zero.
template <std::size_t N>
std::array<Real, N> normalized(std::array<Real, N> v) {
  const Real length = std::sqrt(dot(v, v));
  if (length > 0) {
    for (Real& x : v) x /= length;
  }
  return v;
}

/// e . M e
inline Real quadratic_form(const Symmetric<2>& m, const Point<2>& e) {
  return m[0] * e[0] * e[0] + m[2] * e[1] * e[1] + 2 * m[1] * e[0] * e[1];
}
inline Real quadratic_form(const Symmetric<3>& m, const Point<3>& e) {
  return m[0] * e[0] * e[0] + m[2] * e[1] * e[1] + m[5] * e[2] * e[2] +
         2 * (m[1] * e[0] * e[1] + m[3] * e[0] * e[2] + m[4] * e[1] * e[2]);
}

/// Determinant of the edges from the first vertex: D! times the signed volume.
inline Real edge_determinant(const Point<2>& u, const Point<2>& v) {
  return u[0] * v[1] - u[1] * v[0];
}
inline Real edge_determinant(const Point<3>& u, const Point<3>& v, const Point<3>& w) {
  return u[0] * (v[1] * w[2] - w[1] * v[2]) - u[1] * (v[0] * w[2] - w[0] * v[2]) + u[2] * (v[0] * w[1] - w[0] * v[1]);
}

/// The edges of a simplex from its first vertex.
template <int D>
using Edges = std::array<Point<D>, D>;

template <int D>
Edges<D> edges_of(const std::array<const Point<D>*, D + 1>& x) {
  Edges<D> e;
  for (std::size_t i = 0; i < D; ++i) e[i] = difference<D>(*x[i + 1], *x[0]);
  return e;
}

template <int D>
Real scaled_volume(const Edges<D>& e) {
  if constexpr (D == 2) {
    return edge_determinant(e[0], e[1]);
  } else {
    return edge_determinant(e[0], e[1], e[2]);
  }
}

/// D! times the signed volume; positive for a right-handed order of the vertices.
template <int D>
Real scaled_volume(const std::array<const Point<D>*, D + 1>& x) {
  return scaled_volume<D>(edges_of<D>(x));
}

template <int D>
inline constexpr Real factorial = D == 2 ? 2.0 : 6.0;

/// Vertices of face f (opposite vertex f), ordered so that (face, vertex f) is a positive simplex of a positive one.
template <int D>
struct FaceTable;
template <>
struct FaceTable<2> {
  static constexpr std::array<std::array<std::size_t, 2>, 3> nodes = {{{1, 2}, {2, 0}, {0, 1}}};
};
template <>
struct FaceTable<3> {
  static constexpr std::array<std::array<std::size_t, 3>, 4> nodes = {{{1, 3, 2}, {0, 2, 3}, {0, 3, 1}, {0, 1, 2}}};
};

/// Edges (a, b) of a simplex; in 3D (a, b, rest 0, rest 1) is an even permutation.
template <int D>
struct EdgeTable;
template <>
struct EdgeTable<2> {
  static constexpr std::size_t size = 3;
  static constexpr std::array<std::array<std::size_t, 2>, 3> nodes = {{{0, 1}, {1, 2}, {2, 0}}};
};
template <>
struct EdgeTable<3> {
  static constexpr std::size_t size = 6;
  static constexpr std::array<std::array<std::size_t, 2>, 6> nodes = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
  static constexpr std::array<std::array<std::size_t, 2>, 6> rest = {{{2, 3}, {3, 1}, {1, 2}, {0, 3}, {2, 0}, {0, 1}}};
};

}  // namespace malleus::remeshing
