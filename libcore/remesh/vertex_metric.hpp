#pragma once

/// The metric at a vertex as the remesher's loops want it: squared lengths of edges and shape keys of simplices in
/// metric space. A metric M is a symmetric positive tensor; an edge e has length sqrt(e.M.e), 1 being ideal. Metrics
/// are averaged through their logarithms (Arsigny, Fillard, Pennec, Ayache 2006).

#include <span>

#include "remesh/geometry.hpp"

namespace malleus::remeshing {

/// Shape key of a simplex in metric space: a power of the mean ratio q, monotone in it and free of roots, 1 for the
/// regular simplex, -1 for volumes <= 0. 3D: q^3 = 432 V6^2 / S^3; 2D: q^2 = 12 V2^2 / S^2, with V6, V2 the scaled
/// volumes and S the sum of the squared edge lengths.
template <int D>
Real key_of(Real scaled, Real sum) {
  if (!(scaled > 0)) return -1;
  if constexpr (D == 3) {
    return 432 * scaled * scaled / (sum * sum * sum);
  } else {
    return 12 * scaled * scaled / (sum * sum);
  }
}

/// Key of a mean ratio q in [0, 1], and back (keys <= 0 give 0).
template <int D>
constexpr Real quality_to_key(Real q) {
  return D == 3 ? q * q * q : q * q;
}
template <int D>
Real key_to_quality(Real key) {
  if (key <= 0) return 0;
  return D == 3 ? std::cbrt(key) : std::sqrt(key);
}

/// Sum of the squared lengths of all edges, from the edges of the first vertex.
template <int D>
Real sum_of_squares(const Edges<D>& e) {
  Point<D> total{};
  Real squares = 0;
  for (const auto& edge : e) {
    for (std::size_t i = 0; i < D; ++i) total[i] += edge[i];
    squares += dot(edge, edge);
  }
  return (D + 1) * squares - dot(total, total);
}

/// Isotropic: a size h per vertex.
template <int D>
struct SizeMetric {
  static constexpr bool is_tensor = false;
  using Log = std::array<Real, 1>;  ///< ln(1/h^2)

  Log log{};
  Real inverse_size = 1;

  static SizeMetric from_log(const Log& log) { return {log, std::exp(0.5 * log[0])}; }
  static SizeMetric from_metric(std::span<const Real> inverse_square) {
    return from_log({std::log(inverse_square[0])});
  }
  Symmetric<D> tensor() const {
    Symmetric<D> m{};
    for (int i = 0; i < D; ++i) m[packed(i, i)] = inverse_size * inverse_size;
    return m;
  }
  Symmetric<D> inverse() const {
    Symmetric<D> m{};
    for (int i = 0; i < D; ++i) m[packed(i, i)] = 1 / (inverse_size * inverse_size);
    return m;
  }
};

/// Anisotropic: a tensor per vertex.
template <int D>
struct TensorMetric {
  static constexpr bool is_tensor = true;
  using Log = Symmetric<D>;

  Log log{};
  Symmetric<D> metric{};

  static TensorMetric from_log(const Log& log);
  static TensorMetric from_metric(std::span<const Real> metric);
  const Symmetric<D>& tensor() const { return metric; }
  Symmetric<D> inverse() const;
};

/// exp(A) up to a positive factor, for a symmetric A: A's trace is dropped, so the determinant of the result is 1.
/// 3D: scaling and squaring in the algebra of I, A, A^2 (Cayley-Hamilton), scalars only.
Symmetric<2> normalized_exponential(Symmetric<2> a);
Symmetric<3> normalized_exponential(Symmetric<3> a);

/// Squared metric length of an edge: for sizes |e|^2 / (ha hb); for tensors the square of (2 G + A) / 3 with G and A
/// the geometric and arithmetic means of the lengths in both end metrics, which follows their logarithmic mean.
template <int D>
Real squared_length(const Point<D>& a, const SizeMetric<D>& ma, const Point<D>& b, const SizeMetric<D>& mb) {
  return squared_distance<D>(a, b) * ma.inverse_size * mb.inverse_size;
}
template <int D>
Real squared_length(const Point<D>& a, const TensorMetric<D>& ma, const Point<D>& b, const TensorMetric<D>& mb) {
  const Point<D> e = difference<D>(b, a);
  const Real la = quadratic_form(ma.metric, e);
  const Real lb = quadratic_form(mb.metric, e);
  const Real mean = std::sqrt(la * lb);
  if (la < 2 * lb && lb < 2 * la) return (2 * mean + 0.5 * (la + lb)) / 3;
  const Real length = (2 * std::sqrt(mean) + 0.5 * (std::sqrt(la) + std::sqrt(lb))) / 3;
  return length * length;
}

template <int D, class Metric>
using MetricPointers = std::array<const Metric*, D + 1>;
template <int D>
using PointPointers = std::array<const Point<D>*, D + 1>;

/// Shape key of a simplex in the log-Euclidean mean of its vertices' metrics.
template <int D>
Real shape_key(const PointPointers<D>& x, const MetricPointers<D, SizeMetric<D>>& /*sizes scale, not shape*/) {
  const Edges<D> e = edges_of<D>(x);
  const Real volume = scaled_volume<D>(e);
  if (!(volume > 0)) return -1;
  return key_of<D>(volume, sum_of_squares<D>(e));
}
template <int D>
Real shape_key(const PointPointers<D>& x, const MetricPointers<D, TensorMetric<D>>& m) {
  const Edges<D> e = edges_of<D>(x);
  const Real volume = scaled_volume<D>(e);
  if (!(volume > 0)) return -1;
  Symmetric<D> mean{};
  for (const auto* metric : m) {
    for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += metric->log[i];
  }
  for (Real& value : mean) value /= D + 1;
  const Symmetric<D> unit = normalized_exponential(mean);
  Point<D> total{};
  Real squares = 0;
  for (const auto& edge : e) {
    for (std::size_t i = 0; i < D; ++i) total[i] += edge[i];
    squares += quadratic_form(unit, edge);
  }
  return key_of<D>(volume, (D + 1) * squares - quadratic_form(unit, total));
}

}  // namespace malleus::remeshing
