#include "mesh/space_filling_curve.hpp"

#include <algorithm>

namespace malleus {
namespace {

/// All bits set where the bit of x is.
std::uint32_t mask_of(std::uint32_t x, int bit) {
  return -((x >> bit) & 1U);
}

/// Skilling's in-place transform from axis coordinates to the transposed Hilbert index (2004), without branches: the
/// bits are random.
void axes_to_transpose(std::uint32_t* x, int bits, int dim) {
  for (int bit = bits - 1; bit > 0; --bit) {
    const std::uint32_t lower = (std::uint32_t{1} << bit) - 1;
    for (int i = 0; i < dim; ++i) {
      const std::uint32_t is_set = mask_of(x[i], bit);
      const std::uint32_t swapped = (x[0] ^ x[i]) & lower & ~is_set;
      x[0] ^= (lower & is_set) | swapped;
      x[i] ^= swapped;
    }
  }
  for (int i = 1; i < dim; ++i) x[i] ^= x[i - 1];
  std::uint32_t flips = 0;
  for (int bit = bits - 1; bit > 0; --bit) flips ^= ((std::uint32_t{1} << bit) - 1) & mask_of(x[dim - 1], bit);
  for (int i = 0; i < dim; ++i) x[i] ^= flips;
}

/// One step of spreading bits: those of the upper half of each group move up, the mask keeps both halves.
struct SpreadStep {
  int shift;
  std::uint64_t mask;
};
/// One zero between bits, for 31 of them.
constexpr std::array<SpreadStep, 5> apart_by_one = {{{16, 0x0000ffff0000ffffULL},
                                                     {8, 0x00ff00ff00ff00ffULL},
                                                     {4, 0x0f0f0f0f0f0f0f0fULL},
                                                     {2, 0x3333333333333333ULL},
                                                     {1, 0x5555555555555555ULL}}};
/// Two zeros between bits, for 21 of them.
constexpr std::array<SpreadStep, 5> apart_by_two = {{{32, 0x001f00000000ffffULL},
                                                     {16, 0x001f0000ff0000ffULL},
                                                     {8, 0x100f00f00f00f00fULL},
                                                     {4, 0x10c30c30c30c30c3ULL},
                                                     {2, 0x1249249249249249ULL}}};

std::uint64_t spread(std::uint64_t x, const std::array<SpreadStep, 5>& steps) {
  for (const SpreadStep& step : steps) x = (x | (x << step.shift)) & step.mask;
  return x;
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
  const auto& steps = dim == 2 ? apart_by_one : apart_by_two;
  std::uint64_t key = 0;
  for (int i = 0; i < dim; ++i) key = (key << 1) | spread(x[static_cast<std::size_t>(i)], steps);
  return key;
}

}  // namespace malleus
