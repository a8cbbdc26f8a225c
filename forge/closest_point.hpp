#pragma once

/// The point of a segment or triangle that is closest to a given point.

#include <array>

#include "forge/geometry.hpp"

namespace malleus::forge {

struct ClosestPoint {
  Vector point = Vector::Zero();
  std::array<Real, 3> weights = {0, 0, 0};  ///< barycentric, >= 0, sum 1; exactly 0 where the corner has no part
  Real squared_distance = 1e300;
};

/// corners: 2 (segment) or 3 (triangle; may be flat). Ericson, Real-Time Collision Detection (2005), 5.1.
ClosestPoint closest_on_segment(const Vector& point, const Vector& a, const Vector& b);
ClosestPoint closest_on_triangle(const Vector& point, const Vector& a, const Vector& b, const Vector& c);

}  // namespace malleus::forge
