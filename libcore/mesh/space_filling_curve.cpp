#include "mesh/space_filling_curve.hpp"

#include <algorithm>

namespace malleus {
namespace {

/// Skilling's in-place transform from axis coordinates to the transposed Hilbert index.
void axes_to_transpose(std::uint32_t* x, int bits, int dim) {
  const std::uint32_t top = std::uint32_t{1} << (bits - 1);
  for (std::uint32_t q = top; q > 1; q >>= 1) {
    const std::uint32_t lower = q - 1;
    for (int i = 0; i < dim; ++i) {
      if ((x[i] & q) != 0) {
        x[0] ^= lower;
      } else {
        const std::uint32_t swapped = (x[0] ^ x[i]) & lower;
        x[0] ^= swapped;
        x[i] ^= swapped;
      }
    }
  }
  for (int i = 1; i < dim; ++i) x[i] ^= x[i - 1];
  std::uint32_t flips = 0;
  for (std::uint32_t q = top; q > 1; q >>= 1) {
    if ((x[dim - 1] & q) != 0) flips ^= q - 1;
  }
  for (int i = 0; i < dim; ++i) x[i] ^= flips;
}

}  // namespace

void Box::add(const Real* point, int dim) {
  for (int i = 0; i < dim; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    low[axis] = std::min(low[axis], point[i]);
    high[axis] = std::max(high[axis], point[i]);
  }
}

Box bounding_box(const Communicator& comm, std::span<const Real> points, int dim) {
  Box box;
  for (std::size_t i = 0; i < points.size(); i += static_cast<std::size_t>(dim)) box.add(points.data() + i, dim);
  comm.min_in_place(std::span(box.low));
  comm.max_in_place(std::span(box.high));
  return box;
}

std::uint64_t hilbert_key(const Real* point, int dim, const Box& box) {
  const int bits = dim == 3 ? 21 : 31;
  const Real cells = static_cast<Real>((std::uint64_t{1} << bits) - 1);
  std::array<std::uint32_t, 3> x = {0, 0, 0};
  Real side = 0;
  for (int i = 0; i < dim; ++i)
    side = std::max(side, box.high[static_cast<std::size_t>(i)] - box.low[static_cast<std::size_t>(i)]);
  for (int i = 0; i < dim; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    const Real share = side > 0 ? std::clamp((point[i] - box.low[axis]) / side, 0.0, 1.0) : 0.0;
    x[axis] = static_cast<std::uint32_t>(share * cells);
  }
  axes_to_transpose(x.data(), bits, dim);
  std::uint64_t key = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (int i = 0; i < dim; ++i) key = (key << 1) | ((x[static_cast<std::size_t>(i)] >> bit) & 1U);
  }
  return key;
}

}  // namespace malleus
