#include "partition/bisect.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <numeric>

#include "base/error.hpp"

namespace malleus {
namespace {

/// Refinements of the place of a cut, each dividing the bin it lies in.
constexpr int histogram_rounds = 5;
/// So much the other axes count beside the chosen one: vertices of structured meshes then do not lie in planes, which
/// could only be cut as a whole.
constexpr Real tilt = 1e-3;

/// Vertices that are to be divided among the parts [first, last).
struct Group {
  int first = 0;
  int last = 0;
  std::array<Real, 3> axis = {0, 0, 0};
  Real low = 0;  ///< between these the cut lies, along the axis
  Real high = 0;
  Real below = 0;  ///< weight below low
  Real aim = 0;    ///< weight wanted below the cut
  bool is_divided() const { return last - first > 1; }
  int middle() const { return (first + last) / 2; }
};

class Bisector {
 public:
  Bisector(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares, BisectionAxis axis)
      : comm_(comm), graph_(graph), shares_(shares), axis_(axis), group_of_(graph.weights.size(), 0) {
    groups_.push_back({0, static_cast<int>(shares.size())});
  }

  std::vector<int> run() {
    while (std::any_of(groups_.begin(), groups_.end(), [](const Group& g) { return g.is_divided(); })) {
      if (axis_ == BisectionAxis::inertial) {
        find_inertial_axes();
      } else {
        find_coordinate_axes();
      }
      find_ranges();
      for (int round = 0; round < histogram_rounds; ++round) narrow_ranges();
      divide();
    }
    std::vector<int> parts(group_of_.size());
    for (std::size_t v = 0; v < parts.size(); ++v) parts[v] = groups_[static_cast<std::size_t>(group_of_[v])].first;
    return parts;
  }

 private:
  const Real* centre(std::size_t v) const { return graph_.centres.data() + v * static_cast<std::size_t>(graph_.dim); }
  Group& group_of(std::size_t v) { return groups_[static_cast<std::size_t>(group_of_[v])]; }
  Real place(std::size_t v, const Group& group) const {
    Real t = 0;
    for (int c = 0; c < graph_.dim; ++c) t += group.axis[static_cast<std::size_t>(c)] * centre(v)[c];
    return t;
  }

  void find_inertial_axes() {
    constexpr std::size_t width = 10;  // weight, 3 first moments, 6 second moments
    std::vector<Real> moments(groups_.size() * width, 0);
    for (std::size_t v = 0; v < group_of_.size(); ++v) {
      const Real w = std::max(1.0, graph_.weights[v]) * graph_.unit;
      std::array<Real, 3> x = {0, 0, 0};
      std::copy_n(centre(v), graph_.dim, x.begin());
      Real* m = moments.data() + static_cast<std::size_t>(group_of_[v]) * width;
      *m++ += w;
      for (std::size_t a = 0; a < 3; ++a) *m++ += w * x[a];
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = a; b < 3; ++b) *m++ += w * x[a] * x[b];
      }
    }
    comm_.sum_in_place(std::span<Real>(moments));
    for (std::size_t g = 0; g < groups_.size(); ++g) groups_[g].axis = principal_axis(moments.data() + g * width);
  }

  static std::array<Real, 3> principal_axis(const Real* m) {
    if (m[0] <= 0) return {1, 0, 0};
    const Eigen::Vector3d mean(m[1] / m[0], m[2] / m[0], m[3] / m[0]);
    Eigen::Matrix3d inertia;
    inertia << m[4], m[5], m[6], m[5], m[7], m[8], m[6], m[8], m[9];
    inertia = inertia / m[0] - mean * mean.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia);
    Eigen::Vector3d axis = solver.eigenvectors().col(2);
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    if (axis[largest] < 0) axis = -axis;
    return {axis[0], axis[1], axis[2]};
  }

  void find_coordinate_axes() {
    constexpr std::size_t width = 6;  // the lowest coordinates, and the negated highest ones
    constexpr Real far = 1e300;
    std::vector<Real> boxes(groups_.size() * width, far);
    for (std::size_t v = 0; v < group_of_.size(); ++v) {
      Real* box = boxes.data() + static_cast<std::size_t>(group_of_[v]) * width;
      for (int c = 0; c < graph_.dim; ++c) {
        box[c] = std::min(box[c], centre(v)[c]);
        box[3 + c] = std::min(box[3 + c], -centre(v)[c]);
      }
    }
    comm_.min_in_place(std::span<Real>(boxes));
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Real* box = boxes.data() + g * width;
      int longest = 0;
      for (int c = 1; c < graph_.dim; ++c) {
        if (-box[3 + c] - box[c] > -box[3 + longest] - box[longest]) longest = c;
      }
      groups_[g].axis = {tilt, tilt * 0.7, tilt * 0.4};
      groups_[g].axis[static_cast<std::size_t>(longest)] = 1;
    }
  }

  /// Where each group begins and ends along its axis, and the weight wanted below the cut.
  void find_ranges() {
    constexpr Real far = 1e300;
    std::vector<Real> ranges(groups_.size() * 2, far);
    std::vector<Real> weights(groups_.size(), 0);
    for (std::size_t v = 0; v < group_of_.size(); ++v) {
      const auto g = static_cast<std::size_t>(group_of_[v]);
      const Real t = place(v, groups_[g]);
      ranges[2 * g] = std::min(ranges[2 * g], t);
      ranges[2 * g + 1] = std::min(ranges[2 * g + 1], -t);
      weights[g] += graph_.weights[v];
    }
    comm_.min_in_place(std::span<Real>(ranges));
    comm_.sum_in_place(std::span<Real>(weights));
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      group.below = 0;
      if (ranges[2 * g] >= far) continue;  // nobody there
      group.low = ranges[2 * g];
      group.high = std::nextafter(-ranges[2 * g + 1], far);
      const auto shares = [&](int first, int last) {
        return std::accumulate(shares_.begin() + first, shares_.begin() + last, Real{0});
      };
      group.aim = weights[g] * shares(group.first, group.middle()) / shares(group.first, group.last);
    }
  }

  /// The bin in which the weight below passes the aim becomes the new range.
  void narrow_ranges() {
    const std::size_t bins = std::clamp<std::size_t>(65536 / groups_.size(), 16, 256);
    std::vector<Real> histogram(groups_.size() * bins, 0);
    const auto width = [&](const Group& group) { return (group.high - group.low) / static_cast<Real>(bins); };
    for (std::size_t v = 0; v < group_of_.size(); ++v) {
      const Group& group = group_of(v);
      if (!group.is_divided() || !(width(group) > 0)) continue;
      const Real t = place(v, group);
      if (t < group.low || t >= group.high) continue;
      const auto bin = std::min(bins - 1, static_cast<std::size_t>((t - group.low) / width(group)));
      histogram[static_cast<std::size_t>(group_of_[v]) * bins + bin] += graph_.weights[v];
    }
    comm_.sum_in_place(std::span<Real>(histogram));
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      if (!group.is_divided() || !(width(group) > 0)) continue;
      const Real* weights = histogram.data() + g * bins;
      std::size_t bin = 0;
      while (bin + 1 < bins && group.below + weights[bin] < group.aim) group.below += weights[bin++];
      const Real step = width(group);
      const Real low = group.low;
      group.low = low + step * static_cast<Real>(bin);
      if (bin + 1 < bins) group.high = low + step * static_cast<Real>(bin + 1);
    }
  }

  void divide() {
    std::vector<int> lower(groups_.size());
    std::vector<Group> halves;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Group& group = groups_[g];
      lower[g] = static_cast<int>(halves.size());
      if (!group.is_divided()) {
        halves.push_back(group);
        continue;
      }
      halves.push_back({group.first, group.middle()});
      halves.push_back({group.middle(), group.last});
    }
    for (std::size_t v = 0; v < group_of_.size(); ++v) {
      const Group& group = group_of(v);
      const bool is_above = group.is_divided() && place(v, group) >= group.low;
      group_of_[v] = lower[static_cast<std::size_t>(group_of_[v])] + (is_above ? 1 : 0);
    }
    groups_ = std::move(halves);
  }

  const Communicator& comm_;
  const WorkGraph& graph_;
  std::span<const Real> shares_;
  BisectionAxis axis_;
  std::vector<Group> groups_;
  std::vector<int> group_of_;
};

}  // namespace

std::vector<int> bisect(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares,
                        BisectionAxis axis) {
  check(!shares.empty(), "there is at least one part");
  return Bisector(comm, graph, shares, axis).run();
}

}  // namespace malleus
