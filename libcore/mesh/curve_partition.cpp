#include "mesh/curve_partition.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "base/types.hpp"

namespace malleus {
namespace {

constexpr int key_bits = 63;

/// The items of this rank in the order of their keys, with sums of weights.
struct SortedItems {
  std::vector<std::uint64_t> keys;
  std::vector<GlobalId> weight_before;  ///< [items + 1]

  GlobalId weight_below(std::uint64_t key) const {
    const auto place = std::lower_bound(keys.begin(), keys.end(), key) - keys.begin();
    return weight_before[static_cast<std::size_t>(place)];
  }
};

SortedItems sort_items(std::span<const std::uint64_t> keys, std::span<const GlobalId> weights) {
  SortedItems sorted;
  sorted.weight_before.assign(1, 0);
  if (weights.empty()) {
    sorted.keys.assign(keys.begin(), keys.end());
    std::sort(sorted.keys.begin(), sorted.keys.end());
    sorted.weight_before.resize(keys.size() + 1);
    std::iota(sorted.weight_before.begin(), sorted.weight_before.end(), GlobalId{0});
    return sorted;
  }
  std::vector<std::pair<std::uint64_t, GlobalId>> items(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) items[i] = {keys[i], weights[i]};
  std::sort(items.begin(), items.end());
  for (const auto& [key, weight] : items) {
    sorted.keys.push_back(key);
    sorted.weight_before.push_back(sorted.weight_before.back() + weight);
  }
  return sorted;
}

/// Weight that lies before each boundary between ranks, without overflow for totals up to 2^62.
std::vector<GlobalId> equal_bounds(GlobalId total, int ranks) {
  std::vector<GlobalId> bounds;
  for (int i = 1; i < ranks; ++i) bounds.push_back(total / ranks * i + total % ranks * i / ranks);
  return bounds;
}

std::vector<GlobalId> bounds_of_shares(GlobalId total, std::span<const Real> shares) {
  const Real sum = std::accumulate(shares.begin(), shares.end(), Real{0});
  check(sum > 0, "some part has a share");
  std::vector<GlobalId> bounds;
  Real before = 0;
  for (std::size_t i = 0; i + 1 < shares.size(); ++i) {
    before += shares[i];
    bounds.push_back(static_cast<GlobalId>(static_cast<Real>(total) * std::min(1.0, before / sum)));
  }
  return bounds;
}

/// cuts[i]: the largest key such that no more than bounds[i] lies below it.
std::vector<std::uint64_t> find_cuts(const Communicator& comm, const SortedItems& items,
                                     std::span<const GlobalId> bounds) {
  std::vector<std::uint64_t> cuts(bounds.size(), 0);
  std::vector<GlobalId> below(cuts.size());
  if (cuts.empty()) return cuts;
  for (int bit = key_bits - 1; bit >= 0; --bit) {
    const std::uint64_t step = std::uint64_t{1} << bit;
    for (std::size_t i = 0; i < cuts.size(); ++i) below[i] = items.weight_below(cuts[i] + step);
    comm.sum_in_place(std::span(below));
    for (std::size_t i = 0; i < cuts.size(); ++i) {
      if (below[i] <= bounds[i]) cuts[i] += step;
    }
  }
  return cuts;
}

std::vector<int> cut_at(std::span<const std::uint64_t> keys, const std::vector<std::uint64_t>& cuts) {
  std::vector<int> parts(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    parts[i] = static_cast<int>(std::upper_bound(cuts.begin(), cuts.end(), keys[i]) - cuts.begin());
  }
  return parts;
}

}  // namespace

std::vector<int> curve_partition(const Communicator& comm, std::span<const std::uint64_t> keys,
                                 std::span<const GlobalId> weights) {
  check(weights.empty() || weights.size() == keys.size(), "one weight an item");
  const SortedItems items = sort_items(keys, weights);
  return cut_at(keys, find_cuts(comm, items, equal_bounds(comm.sum(items.weight_before.back()), comm.size())));
}

std::vector<int> curve_partition(const Communicator& comm, std::span<const std::uint64_t> keys,
                                 std::span<const GlobalId> weights, std::span<const Real> shares) {
  check(weights.empty() || weights.size() == keys.size(), "one weight an item");
  const SortedItems items = sort_items(keys, weights);
  return cut_at(keys, find_cuts(comm, items, bounds_of_shares(comm.sum(items.weight_before.back()), shares)));
}

}  // namespace malleus
