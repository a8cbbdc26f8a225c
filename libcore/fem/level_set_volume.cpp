#include "fem/level_set_volume.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "fem/cut_simplex.hpp"

namespace malleus {
namespace {

struct NodalValues {
  std::array<Real, 4> values;
  int count;
  std::span<const Real> span() const { return {values.data(), static_cast<std::size_t>(count)}; }
};

NodalValues gather(const Mesh& mesh, std::span<const Real> field, LocalId element, Real shift = 0) {
  NodalValues nodal{{}, mesh.dim + 1};
  const auto nodes = mesh.nodes_of_element(element);
  for (std::size_t i = 0; i < nodes.size(); ++i) nodal.values[i] = field[static_cast<std::size_t>(nodes[i])] + shift;
  return nodal;
}

/// The volume as a function of the shift: elements that no shift up to `reach` can cut are summed once.
class ShiftedVolume {
 public:
  ShiftedVolume(const Communicator& comm, const Mesh& mesh, std::span<const Real> measures,
                std::span<const Real> level_set, Real reach)
      : comm_(comm), mesh_(mesh), measures_(measures), level_set_(level_set), reach_(reach) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const NodalValues nodal = gather(mesh, level_set, e);
      const auto [low, high] = std::minmax_element(nodal.span().begin(), nodal.span().end());
      if (*low > reach) {
        inside_ += measures[static_cast<std::size_t>(e)];
      } else if (*high > -reach) {
        near_.push_back(e);
      }
    }
  }
  Real operator()(Real shift) const {
    Real volume = inside_;
    for (const LocalId e : near_) {
      volume += measures_[static_cast<std::size_t>(e)] * positive_fraction(gather(mesh_, level_set_, e, shift).span());
    }
    return comm_.sum(volume);
  }
  Real reach() const { return reach_; }

 private:
  const Communicator& comm_;
  const Mesh& mesh_;
  std::span<const Real> measures_, level_set_;
  Real reach_;
  Real inside_ = 0;
  std::vector<LocalId> near_;
};

/// Root of volume(shift) = target between shifts a < b on either side of it: regula falsi with the Illinois rule,
/// guarded by halving. The volume grows with the shift.
Real find_shift(const ShiftedVolume& volume, Real target, Real tolerance, std::array<Real, 2> shifts,
                std::array<Real, 2> errors) {
  auto [a, b] = shifts;
  auto [fa, fb] = errors;
  if (std::abs(fa) <= tolerance) return a;
  if (std::abs(fb) <= tolerance) return b;
  int side = 0;  // of the last point: -1 below the root, 1 above
  for (int pass = 0; pass < 100; ++pass) {
    Real middle = pass % 4 == 3 ? 0.5 * (a + b) : b - fb * (b - a) / (fb - fa);
    if (!(middle > a && middle < b)) middle = 0.5 * (a + b);
    if (middle == a || middle == b) return middle;
    const Real f = volume(middle) - target;
    if (f < 0) {
      a = middle;
      fa = f;
      if (side == -1) fb *= 0.5;
      side = -1;
    } else {
      b = middle;
      fb = f;
      if (side == 1) fa *= 0.5;
      side = 1;
    }
    if (std::abs(f) <= tolerance) return middle;
  }
  return std::abs(fa) < std::abs(fb) ? a : b;
}

}  // namespace

std::vector<Real> element_measures(const Mesh& mesh, bool axisymmetric) {
  std::vector<Real> measures(static_cast<std::size_t>(mesh.elements()));
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const SimplexPoints<D> points = simplex_points<D>(mesh, e);
      const Real turn = axisymmetric ? 2 * std::numbers::pi * points.row(0).mean() : 1;
      measures[static_cast<std::size_t>(e)] = turn * simplex_volume<D>(points);
    }
  });
  return measures;
}

std::vector<LocalId> cut_elements(const Mesh& mesh, std::span<const Real> level_set) {
  std::vector<LocalId> cut;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    if (is_cut(gather(mesh, level_set, e).span())) cut.push_back(e);
  }
  return cut;
}

Real positive_fraction(const Mesh& mesh, std::span<const Real> level_set, LocalId element) {
  return positive_fraction(gather(mesh, level_set, element).span());
}

Real positive_volume(const Communicator& comm, const Mesh& mesh, std::span<const Real> measures,
                     std::span<const Real> level_set, Real shift) {
  Real volume = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    volume += measures[static_cast<std::size_t>(e)] * positive_fraction(gather(mesh, level_set, e, shift).span());
  }
  return comm.sum(volume);
}

VolumeRestoration restore_volume(const Communicator& comm, const Mesh& mesh, std::span<const Real> measures,
                                 std::span<Real> level_set, Real target) {
  const Real total = comm.sum(std::accumulate(measures.begin(), measures.end(), 0.0));
  const Real wanted = std::clamp(target, 0.0, total);
  const Real tolerance = 1e-14 * total;
  std::array<Real, 2> extremes = {0, 0};  // largest of -value and of value
  for (const Real value : level_set) extremes = {std::max(extremes[0], -value), std::max(extremes[1], value)};
  comm.max_in_place(extremes);
  const Real furthest = std::max(extremes[0], extremes[1]);
  if (total == 0 || furthest == 0) return {0, positive_volume(comm, mesh, measures, level_set)};

  std::array<Real, 2> shifts = {0, 0};
  std::array<Real, 2> errors;
  // First reach: a length of the size of an element; doubled until the root lies within.
  Real reach = std::min(furthest, std::pow(total / static_cast<Real>(mesh.total_elements), 1.0 / mesh.dim));
  Real shift = 0;
  for (bool found = false; !found; reach = std::min(furthest * 1.001, 2 * reach)) {
    const ShiftedVolume volume(comm, mesh, measures, level_set, reach);
    const Real error = volume(0) - wanted;
    if (std::abs(error) <= tolerance) break;
    shifts = error < 0 ? std::array<Real, 2>{0, reach} : std::array<Real, 2>{-reach, 0};
    const Real other = volume(error < 0 ? reach : -reach) - wanted;
    errors = error < 0 ? std::array<Real, 2>{error, other} : std::array<Real, 2>{other, error};
    found = errors[0] <= 0 && errors[1] >= 0;
    if (found) shift = find_shift(volume, wanted, tolerance, shifts, errors);
    if (!found && reach >= furthest) {
      shift = error < 0 ? reach : -reach;
      break;
    }
  }
  for (Real& value : level_set) value += shift;
  return {shift, positive_volume(comm, mesh, measures, level_set)};
}

}  // namespace malleus
