#pragma once

/// Place of a point along a Hilbert curve through a box: near on the curve means near in space.

#include <array>
#include <cstdint>
#include <span>

#include "base/types.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// An axis-aligned box; empty (low > high) until a point was added.
struct Box {
  std::array<Real, 3> low = {1e300, 1e300, 1e300};
  std::array<Real, 3> high = {-1e300, -1e300, -1e300};
  void add(const Real* point, int dim);
};

/// Box of the points [n][dim] of all ranks. Collective.
Box bounding_box(const Communicator& comm, std::span<const Real> points, int dim);

/// Key of a point: 62 bits in 2D (31 an axis), 63 bits in 3D (21 an axis). Hilbert's curve by Skilling's transform
/// (AIP Conf. Proc. 707, 381, 2004). Points outside the box are clamped.
std::uint64_t hilbert_key(const Real* point, int dim, const Box& box);

}  // namespace malleus
