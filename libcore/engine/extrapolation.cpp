#include "engine/extrapolation.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.hpp"

namespace malleus {
namespace {

constexpr Real lowest_order = 1.5;
constexpr Real highest_order = 2;
/// Differences that grow faster from mesh to mesh tell that the coarsest is too coarse to tell.
constexpr Real incredible_order = 3;

/// Growth of differences from mesh to mesh at an order: rises with it.
Real growth_at(const std::vector<Real>& sizes, Real order) {
  return (std::pow(sizes[2], order) - std::pow(sizes[1], order)) / (std::pow(sizes[1], order) - 1);
}

struct Distance {
  Real error = 0;    ///< of the finest mesh's result from the limit
  Real scatter = 0;  ///< about the fit, as of the finest mesh
};

/// Least squares of values = limit + slope size^order, each weighted by 1/size^2.
Distance fit(const std::vector<Real>& sizes, const std::vector<Real>& values, Real order) {
  Real sw = 0;
  Real sx = 0;
  Real sy = 0;
  Real sxx = 0;
  Real sxy = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Real w = std::pow(sizes[i], -4);
    const Real x = std::pow(sizes[i], order);
    const Real y = values[i] - values[0];
    sw += w;
    sx += w * x;
    sy += w * y;
    sxx += w * x * x;
    sxy += w * x * y;
  }
  const Real slope = (sw * sxy - sx * sy) / (sw * sxx - sx * sx);
  const Real limit = (sy - slope * sx) / sw;
  Real left = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Real y = values[i] - values[0];
    left += std::pow(sizes[i], -4) * std::pow(limit + slope * std::pow(sizes[i], order) - y, 2);
  }
  const auto freedom = static_cast<Real>(sizes.size()) - 2;
  return {std::abs(limit), freedom > 0 ? std::sqrt(left / freedom) : 0};
}

/// How much larger the difference between the second and the third mesh is than that between the first and the second;
/// none where they have not one direction.
std::optional<Real> growth_of_differences(const MeshComparison& comparison) {
  Real along = 0;
  Real first = 0;
  Real second = 0;
  for (std::size_t i = 0; i < comparison.results[0].size(); ++i) {
    const Real one = comparison.results[1][i] - comparison.results[0][i];
    const Real two = comparison.results[2][i] - comparison.results[1][i];
    along += one * two;
    first += one * one;
    second += two * two;
  }
  if (!(along > 0)) return std::nullopt;
  return std::sqrt(second / first);
}

MeshComparison without_what_is_too_coarse(const MeshComparison& comparison) {
  if (comparison.sizes.size() < 3) return comparison;
  const auto growth = growth_of_differences(comparison);
  if (!growth || *growth <= growth_at(comparison.sizes, incredible_order)) return comparison;
  return {{comparison.sizes[0], comparison.sizes[1]}, {comparison.results[0], comparison.results[1]}};
}

}  // namespace

Real observed_order(const MeshComparison& all) {
  const MeshComparison comparison = without_what_is_too_coarse(all);
  if (comparison.sizes.size() < 3) return usual_order;
  const auto growth = growth_of_differences(comparison);
  if (!growth) return usual_order;
  Real low = lowest_order;
  Real high = highest_order;
  for (int halving = 0; halving < 50; ++halving) {
    const Real middle = (low + high) / 2;
    (growth_at(comparison.sizes, middle) < *growth ? low : high) = middle;
  }
  return (low + high) / 2;
}

Real extrapolated_error(const MeshComparison& all) {
  check(all.sizes.size() >= 2 && all.sizes.size() == all.results.size(),
        "an extrapolation takes the results of two meshes or more");
  const MeshComparison comparison = without_what_is_too_coarse(all);
  const Real order = observed_order(comparison);
  Real scale = 0;
  Distance sum;
  for (std::size_t i = 0; i < comparison.results[0].size(); ++i) {
    std::vector<Real> values;
    for (const std::vector<Real>& of_mesh : comparison.results) values.push_back(of_mesh[i]);
    scale += std::abs(values[0]);
    const Distance distance = fit(comparison.sizes, values, order);
    sum.error += distance.error;
    sum.scatter += distance.scatter;
  }
  return scale > 0 ? std::hypot(sum.error, sum.scatter) / scale : 0;
}

}  // namespace malleus
