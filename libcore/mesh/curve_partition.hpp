#pragma once

/// Division of weighted items among ranks along a space-filling curve.

#include <cstdint>
#include <span>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Rank of each item, such that ranks hold consecutive stretches of the curve of equal weight, to within one item (and
/// items of equal key, which stay together). keys: place on the curve, < 2^63; weights: >= 0, or empty = 1 each. The
/// result depends on the items of all ranks together, not on where they lie. The cut keys are found by bisection:
/// 63 reductions of one number per rank. Collective.
std::vector<int> curve_partition(const Communicator& comm, std::span<const std::uint64_t> keys,
                                 std::span<const GlobalId> weights);

/// The same for any number of parts in proportion to their shares (>= 0, not all 0): the part of each item. Collective.
std::vector<int> curve_partition(const Communicator& comm, std::span<const std::uint64_t> keys,
                                 std::span<const GlobalId> weights, std::span<const Real> shares);

}  // namespace malleus
