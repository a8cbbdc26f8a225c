#include "remesh/plane_cuts.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/index.hpp"

namespace malleus {
namespace {

constexpr std::size_t bins = 128;  ///< of a histogram in which a plane's place is sought
constexpr int sweeps = 3;          ///< of histograms, each within one bin of the last

/// The direction in which points lie farthest apart: an axis, or where that is much longer the principal one. A little
/// askew, so that the planes of a regular mesh's centroids do not coincide with it.
std::array<Real, 3> longest_direction(const Eigen::Matrix3d& covariance) {
  constexpr Real much = 1.3;
  constexpr std::array<Real, 3> skew = {0.011, 0.017, 0.013};
  int axis = 0;
  for (int i = 1; i < 3; ++i) {
    if (covariance(i, i) > 1.01 * covariance(axis, axis)) axis = i;
  }
  Eigen::Vector3d normal = Eigen::Vector3d::Unit(axis);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  if (solver.eigenvalues()[2] > much * covariance(axis, axis)) normal = solver.eigenvectors().col(2);
  for (int i = 0; i < 3; ++i) {
    if (covariance(i, i) > 0) normal[i] += skew[static_cast<std::size_t>(i)];
  }
  normal.normalize();
  return {normal[0], normal[1], normal[2]};
}

}  // namespace

/// The branches of one depth are cut together: their sums over the ranks travel in one message.
class PlaneCuts::Level {
 public:
  Level(const Communicator& comm, PlaneCuts& owner, std::span<const Real> points, std::span<const Real> weights,
        std::size_t first, std::size_t count)
      : comm_(comm), owner_(owner), points_(points), weights_(weights), first_(first), count_(count) {}

  void cut(std::vector<std::size_t>& branch) {
    find_directions(branch);
    find_offsets(branch);
    for (std::size_t n = 0; n < branch.size(); ++n) {
      if (is_cut(branch[n])) branch[n] = owner_.child(branch[n], point(n));
    }
  }

 private:
  const Real* point(std::size_t n) const { return points_.data() + n * static_cast<std::size_t>(owner_.dim_); }
  bool is_cut(std::size_t branch) const { return branch >= first_ && !owner_.cuts_[branch].is_leaf(); }

  void find_directions(const std::vector<std::size_t>& branch) {
    constexpr std::size_t width = 10;  // weight, weighted place, its products
    std::vector<Real> sums(count_ * width, 0);
    for (std::size_t n = 0; n < branch.size(); ++n) {
      if (!is_cut(branch[n])) continue;
      Real* sum = sums.data() + (branch[n] - first_) * width;
      sum[0] += weights_[n];
      std::size_t at = 4;
      for (int i = 0; i < owner_.dim_; ++i) sum[1 + i] += weights_[n] * point(n)[i];
      for (int i = 0; i < owner_.dim_; ++i) {
        for (int j = 0; j <= i; ++j) sum[at++] += weights_[n] * point(n)[i] * point(n)[j];
      }
    }
    comm_.sum_in_place(std::span(sums));
    for (std::size_t b = 0; b < count_; ++b) {
      const Real* sum = sums.data() + b * width;
      Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
      std::size_t at = 4;
      for (int i = 0; i < owner_.dim_ && sum[0] > 0; ++i) {
        for (int j = 0; j <= i; ++j)
          covariance(i, j) = covariance(j, i) = sum[at++] / sum[0] - sum[1 + i] / sum[0] * sum[1 + j] / sum[0];
      }
      owner_.cuts_[first_ + b].normal = longest_direction(covariance);
    }
  }

  /// Narrows the range of each plane's place to that bin in which the weight below reaches its share.
  void find_offsets(const std::vector<std::size_t>& branch) {
    constexpr Real none = -1e300;
    std::vector<Real> reach(2 * count_, none);  // highest, highest of the negative
    for (std::size_t n = 0; n < branch.size(); ++n) {
      if (!is_cut(branch[n])) continue;
      const Real height = owner_.height(owner_.cuts_[branch[n]], point(n));
      Real* mine = reach.data() + 2 * (branch[n] - first_);
      mine[0] = std::max(mine[0], height);
      mine[1] = std::max(mine[1], -height);
    }
    comm_.max_in_place(std::span(reach));
    std::vector<Range> ranges(count_);
    for (std::size_t b = 0; b < count_; ++b) {
      const bool is_empty = reach[2 * b] < -reach[2 * b + 1];
      ranges[b] = is_empty ? Range{0, 0, 0, -1} : Range{-reach[2 * b + 1], reach[2 * b], 0, -1};
    }
    for (int sweep = 0; sweep < sweeps; ++sweep) narrow(branch, ranges);
    for (std::size_t b = 0; b < count_; ++b) owner_.cuts_[first_ + b].offset = 0.5 * (ranges[b].low + ranges[b].high);
  }

  struct Range {
    Real low, high;
    Real below;   ///< weight below it
    Real wanted;  ///< weight on the lower side; -1: not known yet
  };

  void narrow(const std::vector<std::size_t>& branch, std::vector<Range>& ranges) const {
    std::vector<Real> histogram(count_ * bins, 0);
    for (std::size_t n = 0; n < branch.size(); ++n) {
      if (!is_cut(branch[n])) continue;
      const Range& range = ranges[branch[n] - first_];
      const Real height = owner_.height(owner_.cuts_[branch[n]], point(n));
      if (height < range.low || height > range.high || !(range.high > range.low)) continue;
      const auto bin = static_cast<std::size_t>((height - range.low) / (range.high - range.low) * bins);
      histogram[(branch[n] - first_) * bins + std::min(bin, bins - 1)] += weights_[n];
    }
    comm_.sum_in_place(std::span(histogram));
    for (std::size_t b = 0; b < count_; ++b) {
      Range& range = ranges[b];
      const Real* mine = histogram.data() + b * bins;
      const Cut& cut = owner_.cuts_[first_ + b];
      if (range.wanted < 0) {
        Real all = 0;
        for (std::size_t k = 0; k < bins; ++k) all += mine[k];
        range.wanted = all * (cut.parts / 2) / std::max(1, cut.parts);
      }
      std::size_t k = 0;
      while (k + 1 < bins && range.below + mine[k] < range.wanted) range.below += mine[k++];
      const Real width = (range.high - range.low) / bins;
      range.low += width * static_cast<Real>(k);
      range.high = range.low + width;
    }
  }

  const Communicator& comm_;
  PlaneCuts& owner_;
  std::span<const Real> points_;
  std::span<const Real> weights_;
  std::size_t first_;
  std::size_t count_;
};

PlaneCuts::PlaneCuts(const Communicator& comm, int dim, std::span<const Real> points, std::span<const Real> weights,
                     int parts)
    : dim_(dim) {
  cuts_.resize(1);
  cuts_[0].parts = parts;
  std::vector<std::size_t> branch(weights.size(), 0);
  const auto is_cut = [](const Cut& cut) { return !cut.is_leaf(); };
  for (std::size_t first = 0, count = 1;
       std::any_of(cuts_.begin() + static_cast<std::ptrdiff_t>(first), cuts_.end(), is_cut);
       first += count, count *= 2) {
    cuts_.resize(first + 3 * count);
    for (std::size_t b = first; b < first + count; ++b) {
      const Cut cut = cuts_[b];
      if (cut.is_leaf()) continue;
      cuts_[2 * b + 1].first = cut.first;
      cuts_[2 * b + 1].parts = cut.parts / 2;
      cuts_[2 * b + 2].first = cut.first + cut.parts / 2;
      cuts_[2 * b + 2].parts = cut.parts - cut.parts / 2;
    }
    Level(comm, *this, points, weights, first, count).cut(branch);
  }
}

Real PlaneCuts::height(const Cut& cut, const Real* point) const {
  Real sum = 0;
  for (int i = 0; i < dim_; ++i) sum += cut.normal[static_cast<std::size_t>(i)] * point[i];
  return sum;
}

std::size_t PlaneCuts::child(std::size_t branch, const Real* point) const {
  return 2 * branch + (height(cuts_[branch], point) < cuts_[branch].offset ? 1 : 2);
}

int PlaneCuts::part_of(const Real* point) const {
  std::size_t branch = 0;
  while (!cuts_[branch].is_leaf()) branch = child(branch, point);
  return cuts_[branch].first;
}

}  // namespace malleus
