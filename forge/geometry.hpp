#pragma once

/// Points and directions of the forging process: three components always, z = 0 in 2D.

#include <Eigen/Dense>
#include <algorithm>

#include "base/types.hpp"

namespace malleus::forge {

using Vector = Eigen::Vector3d;  ///< m, m/s or 1, as said where it is used
using Matrix = Eigen::Matrix3d;

/// The first dim numbers at `values`; z = 0 in 2D.
inline Vector to_vector(const Real* values, int dim) {
  return {values[0], values[1], dim == 3 ? values[2] : 0.0};
}

/// Axis-aligned box; empty until something was added.
struct Bounds {
  Vector low = Vector::Constant(1e300);
  Vector high = Vector::Constant(-1e300);

  bool empty() const { return low[0] > high[0]; }
  void add(const Vector& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  void add(const Bounds& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  /// Squared distance of a point; 0 inside, beyond any other number for an empty box.
  Real squared_distance(const Vector& point) const {
    if (empty()) return 1e300;
    return (low - point).cwiseMax(point - high).cwiseMax(0.0).squaredNorm();
  }
};

}  // namespace malleus::forge
