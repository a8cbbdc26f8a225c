#include "partition/border_shares.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/index.hpp"
#include "parallel/gather.hpp"

namespace malleus {
namespace {

/// What one rank sees of a border, to be sent.
struct BorderPart {
  int low;
  int high;
  Border border;
};

Border empty_border() {
  Border border;
  border.lowest.fill(std::numeric_limits<Real>::max());
  border.highest.fill(std::numeric_limits<Real>::lowest());
  return border;
}

void merge(Border& into, const Border& from) {
  into.from_low += from.from_low;
  into.from_high += from.from_high;
  for (std::size_t c = 0; c < 3; ++c) {
    into.lowest[c] = std::min(into.lowest[c], from.lowest[c]);
    into.highest[c] = std::max(into.highest[c], from.highest[c]);
  }
}

std::pair<int, int> ordered(int part, int other) {
  return {std::min(part, other), std::max(part, other)};
}

/// Counts of a border's nodes along its axis, to place its cut by.
struct Histogram {
  static constexpr std::size_t bins = 64;
  int low = 0;
  int high = 0;
  std::array<std::int32_t, bins> count{};

  static std::size_t bin_of(const Border& border, const Real* point) {
    const auto axis = static_cast<std::size_t>(border.axis);
    const Real place = (point[axis] - border.lowest[axis]) / border.extent();
    return std::min(bins - 1, static_cast<std::size_t>(std::max(0.0, place * static_cast<Real>(bins))));
  }
};

}  // namespace

BorderShares::BorderShares(const Communicator& comm, const Mesh& mesh, const AroundNodes& around,
                           std::span<const std::uint8_t> released, std::span<const Real> work,
                           std::span<const int> parts)
    : comm_(comm), mesh_(mesh), around_(around), released_(released) {
  std::map<std::pair<int, int>, Border> seen;
  std::vector<int> others;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const int part = parts[index(e)];
    others.clear();
    for (const LocalId node : mesh.nodes_of_element(e)) {
      if (released[index(node)] == 0) continue;
      for (const int other : around.of(node)) {
        if (other == part) continue;
        Border& border = seen.try_emplace(ordered(part, other), empty_border()).first->second;
        for (std::size_t c = 0; c < static_cast<std::size_t>(mesh.dim); ++c) {
          border.lowest[c] = std::min(border.lowest[c], mesh.point(node)[c]);
          border.highest[c] = std::max(border.highest[c], mesh.point(node)[c]);
        }
        if (std::find(others.begin(), others.end(), other) == others.end()) others.push_back(other);
      }
    }
    for (const int other : others) {
      Border& border = seen.at(ordered(part, other));
      (part < other ? border.from_low : border.from_high) += work[index(e)] / static_cast<Real>(others.size());
    }
  }
  std::vector<BorderPart> mine;
  for (const auto& [pair, border] : seen) mine.push_back({pair.first, pair.second, border});
  for (const BorderPart& one : gather_lists<BorderPart>(comm, mine))
    merge(borders_.try_emplace({one.low, one.high}, empty_border()).first->second, one.border);
  for (auto& [pair, border] : borders_) {
    for (int c = 1; c < mesh.dim; ++c) {
      const auto length = [&](int axis) {
        return border.highest[static_cast<std::size_t>(axis)] - border.lowest[static_cast<std::size_t>(axis)];
      };
      if (length(c) > length(border.axis)) border.axis = c;
    }
  }
}

/// Whole borders: the heaviest first to the part that has less, then from side to side while that helps.
void BorderShares::choose_sides(std::vector<Real>& measures) {
  constexpr int sweeps = 30;
  std::vector<std::pair<Real, std::pair<int, int>>> order;
  for (const auto& [pair, border] : borders_) order.push_back({border.work(), pair});
  std::sort(order.rbegin(), order.rend());
  bool turned = true;
  for (int sweep = 0; sweep < sweeps && turned; ++sweep) {
    turned = false;
    for (const auto& [work, pair] : order) {
      Border& border = borders_.at(pair);
      Real& low = measures[static_cast<std::size_t>(pair.first)];
      Real& high = measures[static_cast<std::size_t>(pair.second)];
      // The other way round the two measures would differ by what they do now, less twice the border's work.
      const Real change = border.share > 0 ? -work : work;
      if (std::abs(high - low - 2 * change) >= std::abs(high - low)) continue;
      border.share = border.share > 0 ? 0 : 1;
      low += change;
      high -= change;
      turned = true;
    }
  }
}

/// Divides borders where the measures on their sides still differ.
void BorderShares::divide(std::vector<Real>& measures, Real slack) {
  constexpr int sweeps = 100;
  bool divided = true;
  for (int sweep = 0; sweep < sweeps && divided; ++sweep) {
    divided = false;
    for (auto& [pair, border] : borders_) {
      Real& low = measures[static_cast<std::size_t>(pair.first)];
      Real& high = measures[static_cast<std::size_t>(pair.second)];
      if (std::abs(high - low) <= slack || border.work() <= 0 || !(border.extent() > 0)) continue;
      const Real share = std::clamp(border.share + 0.5 * (high - low) / border.work(), 0.0, 1.0);
      const Real change = (share - border.share) * border.work();
      if (std::abs(change) < 0.25 * slack) continue;
      border.share = share;
      low += change;
      high -= change;
      divided = true;
    }
  }
}

/// Where a border is divided: at the quantile of its nodes along its longest extent.
void BorderShares::place_cuts() {
  std::map<std::pair<int, int>, Histogram> histograms;
  for (const auto& [pair, border] : borders_) {
    if (border.share > 0 && border.share < 1) histograms[pair] = {pair.first, pair.second, {}};
  }
  for (LocalId node = 0; node < mesh_.owned_nodes() && !histograms.empty(); ++node) {
    if (released_[index(node)] == 0) continue;
    const auto here = around_.of(node);
    for (std::size_t i = 0; i < here.size(); ++i) {
      for (std::size_t j = i + 1; j < here.size(); ++j) {
        const auto found = histograms.find({here[i], here[j]});
        if (found == histograms.end()) continue;
        ++found->second.count[Histogram::bin_of(borders_.at(found->first), mesh_.point(node))];
      }
    }
  }
  std::vector<Histogram> mine;
  for (const auto& [pair, histogram] : histograms) mine.push_back(histogram);
  for (auto& [pair, histogram] : histograms) histogram.count.fill(0);
  for (const Histogram& one : gather_lists<Histogram>(comm_, mine)) {
    auto& count = histograms.at({one.low, one.high}).count;
    for (std::size_t b = 0; b < Histogram::bins; ++b) count[b] += one.count[b];
  }
  for (auto& [pair, border] : borders_) {
    const auto axis = static_cast<std::size_t>(border.axis);
    border.cut = border.share > 0 ? std::numeric_limits<Real>::max() : std::numeric_limits<Real>::lowest();
    const auto found = histograms.find(pair);
    if (found == histograms.end()) continue;
    const auto& count = found->second.count;
    Real left = 0;
    for (const std::int32_t n : count) left += n;
    left *= border.share;
    std::size_t bin = 0;
    while (bin + 1 < Histogram::bins && left > count[bin]) left -= count[bin++];
    const Real part = count[bin] > 0 ? left / count[bin] : 0;
    border.cut = border.lowest[axis] + (static_cast<Real>(bin) + part) / static_cast<Real>(Histogram::bins) *
                                           (border.highest[axis] - border.lowest[axis]);
  }
}

void BorderShares::level(std::vector<Real> measures, Real slack) {
  for (auto& [pair, border] : borders_) border.share = 0;
  choose_sides(measures);
  divide(measures, slack);
  place_cuts();
}

bool BorderShares::takes(int part, int other, const Real* point) const {
  const auto found = borders_.find(ordered(part, other));
  if (found == borders_.end()) return false;
  const bool low_takes = point[found->second.axis] < found->second.cut;
  return low_takes == (part < other);
}

}  // namespace malleus
