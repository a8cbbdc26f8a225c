#include "forge/closest_point.hpp"

namespace malleus::forge {
namespace {

ClosestPoint combine(const Vector& point, const std::array<const Vector*, 3>& corners, std::array<Real, 3> weights) {
  ClosestPoint closest;
  closest.weights = weights;
  for (std::size_t i = 0; i < 3; ++i) {
    if (corners[i] != nullptr) closest.point += weights[i] * *corners[i];
  }
  closest.squared_distance = (point - closest.point).squaredNorm();
  return closest;
}

/// Where along a -> b, in [0, 1], the foot of the point lies.
Real place_on_segment(const Vector& point, const Vector& a, const Vector& b) {
  const Vector edge = b - a;
  const Real length2 = edge.squaredNorm();
  return length2 > 0 ? std::clamp(edge.dot(point - a) / length2, 0.0, 1.0) : 0.0;
}

ClosestPoint closest_on_border(const Vector& point, const std::array<const Vector*, 3>& corners) {
  ClosestPoint best;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const Real t = place_on_segment(point, *corners[i], *corners[j]);
    std::array<Real, 3> weights = {0, 0, 0};
    weights[i] = 1 - t;
    weights[j] = t;
    const ClosestPoint candidate = combine(point, corners, weights);
    if (candidate.squared_distance < best.squared_distance) best = candidate;
  }
  return best;
}

}  // namespace

ClosestPoint closest_on_segment(const Vector& point, const Vector& a, const Vector& b) {
  const Real t = place_on_segment(point, a, b);
  return combine(point, {&a, &b, nullptr}, {1 - t, t, 0});
}

ClosestPoint closest_on_triangle(const Vector& point, const Vector& a, const Vector& b, const Vector& c) {
  const Vector normal = (b - a).cross(c - a);
  const Real area2 = normal.squaredNorm();
  if (area2 > 0) {
    const Real wa = normal.dot((b - point).cross(c - point)) / area2;
    const Real wb = normal.dot((c - point).cross(a - point)) / area2;
    const Real wc = normal.dot((a - point).cross(b - point)) / area2;
    if (wa >= 0 && wb >= 0 && wc >= 0) {
      const Real sum = wa + wb + wc;
      return combine(point, {&a, &b, &c}, {wa / sum, wb / sum, wc / sum});
    }
  }
  return closest_on_border(point, {&a, &b, &c});
}

}  // namespace malleus::forge
