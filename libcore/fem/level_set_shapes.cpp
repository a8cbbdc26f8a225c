#include "fem/level_set_shapes.hpp"

#include <algorithm>
#include <cmath>

namespace malleus {

Real signed_distance(const Sphere& sphere, const Position& at) {
  Real square = 0;
  for (std::size_t c = 0; c < 3; ++c) square += (at[c] - sphere.center[c]) * (at[c] - sphere.center[c]);
  return sphere.radius - std::sqrt(square);
}

Real signed_distance(const AxisBox& box, const Position& at) {
  Real beyond_square = 0;
  Real largest = -1e300;
  for (std::size_t c = 0; c < static_cast<std::size_t>(box.dim); ++c) {
    const Real beyond = std::abs(at[c] - box.center[c]) - 0.5 * box.size[c];
    beyond_square += std::max(beyond, 0.0) * std::max(beyond, 0.0);
    largest = std::max(largest, beyond);
  }
  return largest > 0 ? -std::sqrt(beyond_square) : -largest;
}

Real signed_distance(const HalfSpace& half_space, const Position& at) {
  Real along = 0;
  Real square = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    along += (half_space.point[c] - at[c]) * half_space.normal[c];
    square += half_space.normal[c] * half_space.normal[c];
  }
  return along / std::sqrt(square);
}

}  // namespace malleus
