#include "fem/cut_simplex.hpp"

#include <algorithm>

#include "base/error.hpp"

namespace malleus {
namespace {

/// Vertices by sign: those above zero first.
struct Signs {
  std::array<int, 4> order = {};
  int above = 0;
};

Signs sort_by_sign(std::span<const Real> values) {
  Signs signs;
  const int n = static_cast<int>(values.size());
  for (int i = 0; i < n; ++i) {
    if (values[static_cast<std::size_t>(i)] > 0) signs.order[static_cast<std::size_t>(signs.above++)] = i;
  }
  int next = signs.above;
  for (int i = 0; i < n; ++i) {
    if (!(values[static_cast<std::size_t>(i)] > 0)) signs.order[static_cast<std::size_t>(next++)] = i;
  }
  return signs;
}

/// Where the edge from a (one sign) to b (the other) crosses zero, as a share of it from a.
Real crossing(Real a, Real b) {
  return a / (a - b);
}

/// Share of the corner that is cut off at vertex `apex`, alone with its sign.
Real corner(std::span<const Real> values, int apex) {
  Real share = 1;
  for (int i = 0; i < static_cast<int>(values.size()); ++i) {
    if (i == apex) continue;
    share *= crossing(values[static_cast<std::size_t>(apex)], values[static_cast<std::size_t>(i)]);
  }
  return share;
}

/// Share of the wedge at the edge a-b of a tetrahedron whose other edge c-d lies on the other side, as three
/// tetrahedra of positive volume: (a, b, ac, ad), (b, ac, ad, bd), (b, ac, bd, bc) with xy the crossing of edge x-y.
Real wedge(Real a, Real b, Real c, Real d) {
  const Real ac = crossing(a, c), ad = crossing(a, d), bc = crossing(b, c), bd = crossing(b, d);
  return ac * ad + ac * bd * (1 - ad) + (1 - ac) * bc * bd;
}

template <int D>
Point<D> edge_crossing(const SimplexPoints<D>& points, std::span<const Real> values, int i, int j) {
  const Real share = crossing(values[static_cast<std::size_t>(i)], values[static_cast<std::size_t>(j)]);
  return points.col(i) + share * (points.col(j) - points.col(i));
}

}  // namespace

Real positive_fraction(std::span<const Real> values) {
  const Signs signs = sort_by_sign(values);
  const int n = static_cast<int>(values.size());
  const auto at = [&](int i) { return values[static_cast<std::size_t>(signs.order[static_cast<std::size_t>(i)])]; };
  if (signs.above == 0) return 0;
  if (signs.above == n) return 1;
  if (signs.above == 1) return corner(values, signs.order[0]);
  if (signs.above == n - 1) return 1 - corner(values, signs.order[static_cast<std::size_t>(n - 1)]);
  return wedge(at(0), at(1), at(2), at(3));
}

bool is_cut(std::span<const Real> values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return *low < 0 && *high > 0;
}

template <int D>
ZeroFacets<D> zero_facets(const SimplexPoints<D>& points, std::span<const Real> values) {
  ZeroFacets<D> zero;
  if (!is_cut(values)) return zero;
  const Signs signs = sort_by_sign(values);
  if (D == 3 && signs.above == 2) {
    const auto [a, b, c, d] = signs.order;
    const auto ac = edge_crossing<D>(points, values, a, c), ad = edge_crossing<D>(points, values, a, d);
    const auto bc = edge_crossing<D>(points, values, b, c), bd = edge_crossing<D>(points, values, b, d);
    zero.count = 2;
    zero.facets[0].col(0) = zero.facets[1].col(0) = ac;
    zero.facets[0].col(1) = ad;
    zero.facets[0].col(D - 1) = zero.facets[1].col(1) = bd;
    zero.facets[1].col(D - 1) = bc;
    return zero;
  }
  const int apex = signs.above == 1 ? signs.order[0] : signs.order[D];
  zero.count = 1;
  int column = 0;
  for (int i = 0; i <= D; ++i) {
    if (i != apex) zero.facets[0].col(column++) = edge_crossing<D>(points, values, apex, i);
  }
  return zero;
}

template <int D>
Real facet_measure(const Eigen::Matrix<Real, D, D>& facet) {
  const Point<D> edge = facet.col(1) - facet.col(0);
  if constexpr (D == 2) return edge.norm();
  if constexpr (D == 3) return 0.5 * edge.cross(Point<D>(facet.col(2) - facet.col(0))).norm();
}

namespace {

template <int D>
Point<D> closest_on_segment(const Point<D>& a, const Point<D>& b, const Point<D>& point) {
  const Point<D> edge = b - a;
  const Real square = edge.squaredNorm();
  if (!(square > 0)) return a;
  return a + std::clamp((point - a).dot(edge) / square, 0.0, 1.0) * edge;
}

/// In the interior where the projection falls inside, else on the nearest edge.
Point<3> closest_on_triangle(const Eigen::Matrix<Real, 3, 3>& facet, const Point<3>& point) {
  const Point<3> u = facet.col(1) - facet.col(0), v = facet.col(2) - facet.col(0), w = point - facet.col(0);
  const Real uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm();
  const Real determinant = uu * vv - uv * uv;
  if (determinant > 1e-24 * uu * vv) {
    const Real s = (vv * u.dot(w) - uv * v.dot(w)) / determinant;
    const Real t = (uu * v.dot(w) - uv * u.dot(w)) / determinant;
    if (s >= 0 && t >= 0 && s + t <= 1) return facet.col(0) + s * u + t * v;
  }
  Point<3> best = facet.col(0);
  for (int i = 0; i < 3; ++i) {
    const Point<3> candidate = closest_on_segment<3>(facet.col(i), facet.col((i + 1) % 3), point);
    if ((candidate - point).squaredNorm() < (best - point).squaredNorm()) best = candidate;
  }
  return best;
}

}  // namespace

template <int D>
Point<D> closest_point(const Eigen::Matrix<Real, D, D>& facet, const Point<D>& point) {
  if constexpr (D == 2) return closest_on_segment<2>(facet.col(0), facet.col(1), point);
  if constexpr (D == 3) return closest_on_triangle(facet, point);
}

template ZeroFacets<2> zero_facets<2>(const SimplexPoints<2>&, std::span<const Real>);
template ZeroFacets<3> zero_facets<3>(const SimplexPoints<3>&, std::span<const Real>);
template Real facet_measure<2>(const Eigen::Matrix<Real, 2, 2>&);
template Real facet_measure<3>(const Eigen::Matrix<Real, 3, 3>&);
template Point<2> closest_point<2>(const Eigen::Matrix<Real, 2, 2>&, const Point<2>&);
template Point<3> closest_point<3>(const Eigen::Matrix<Real, 3, 3>&, const Point<3>&);

}  // namespace malleus
