#pragma once

/// The part of a simplex where a linear function is positive: exact fractions and the zero facets.

#include <array>
#include <span>

#include "mesh/simplex.hpp"

namespace malleus {

/// Share of a triangle's area (3 values) or a tetrahedron's volume (4 values) where the linear function with these
/// values at the vertices is positive: 0..1, exact up to rounding, continuous in the values. All zero: 0. Also of a
/// segment (2 values). The share for -values is 1 minus this one wherever the function is not zero throughout. Local.
Real positive_fraction(std::span<const Real> values);

/// Whether the function changes its sign inside: a vertex above zero and one below.
bool is_cut(std::span<const Real> values);

/// Zero set of a linear function in a simplex: `count` simplices of dimension D-1 (a segment in 2D; in 3D a triangle,
/// or two that make a quadrilateral), a column a vertex. Empty where !is_cut(values).
template <int D>
struct ZeroFacets {
  using Facet = Eigen::Matrix<Real, D, D>;
  int count = 0;
  std::array<Facet, 2> facets;
};
template <int D>
ZeroFacets<D> zero_facets(const SimplexPoints<D>& points, std::span<const Real> values);

/// Length of a segment (D = 2) or area of a triangle (D = 3).
template <int D>
Real facet_measure(const Eigen::Matrix<Real, D, D>& facet);

/// Point of the facet that is closest to `point`.
template <int D>
Point<D> closest_point(const Eigen::Matrix<Real, D, D>& facet, const Point<D>& point);

}  // namespace malleus
