#include "fem/viscosity_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace malleus {

namespace {

Real stress_at(const ViscousLaw& law, Real rate) {
  Real viscosity = 0;
  Real slope = 0;
  law.evaluate({&rate, 1}, {&viscosity, 1}, {&slope, 1});
  return viscosity * rate;
}

/// The rate up to `rate` at which a law bears a stress that it exceeds there: stresses grow with the rate.
Real rate_at_stress(const ViscousLaw& law, Real stress, Real rate) {
  constexpr Real least_share = 1e-12;
  constexpr int halvings = 50;
  Real low = std::log(rate * least_share);
  Real high = std::log(rate);
  for (int i = 0; i < halvings; ++i) {
    const Real middle = 0.5 * (low + high);
    (stress_at(law, std::exp(middle)) < stress ? low : high) = middle;
  }
  return std::exp(high);
}

}  // namespace

void RegionViscosity::evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                               std::span<Real> slope) const {
  const auto elements = static_cast<std::size_t>(mesh.elements());
  std::size_t begin = 0;
  while (begin < elements) {  // a run of elements of one region at a time
    const auto region = mesh.element_region[begin];
    std::size_t end = begin + 1;
    while (end < elements && mesh.element_region[end] == region) ++end;
    const auto* law = laws_.at(static_cast<std::size_t>(region)).get();
    const std::size_t count = end - begin;
    if (law != nullptr) {
      law->evaluate(shear_rate.subspan(begin, count), viscosity.subspan(begin, count), slope.subspan(begin, count));
    } else {
      std::fill_n(viscosity.begin() + static_cast<std::ptrdiff_t>(begin), count, 0.0);
      std::fill_n(slope.begin() + static_cast<std::ptrdiff_t>(begin), count, 0.0);
    }
    begin = end;
  }
}

void RegionViscosity::start_rates(const Mesh& mesh, Real rate, std::span<Real> shear_rate) const {
  Real least = std::numeric_limits<Real>::infinity();
  for (const auto& law : laws_) {
    if (law != nullptr) least = std::min(least, stress_at(*law, rate));
  }
  std::vector<Real> rates;
  for (const auto& law : laws_) {
    rates.push_back(law != nullptr && stress_at(*law, rate) > least ? rate_at_stress(*law, least, rate) : rate);
  }
  for (std::size_t e = 0; e < shear_rate.size(); ++e) {
    shear_rate[e] = rates[static_cast<std::size_t>(mesh.element_region[e])];
  }
}

Real RegionViscosity::sensitivity() const {
  Real smallest = 1;
  for (const auto& law : laws_) {
    if (law != nullptr) smallest = std::min(smallest, law->sensitivity());
  }
  return smallest;
}

bool RegionViscosity::is_linear() const {
  return std::all_of(laws_.begin(), laws_.end(), [](const auto& law) { return law == nullptr || law->is_linear(); });
}

void GivenViscosity::evaluate(const Mesh& mesh, std::span<const Real>, std::span<Real> viscosity,
                              std::span<Real> slope) const {
  check(viscosity_.size() == static_cast<std::size_t>(mesh.elements()), "a viscosity for each element");
  std::copy(viscosity_.begin(), viscosity_.end(), viscosity.begin());
  std::fill(slope.begin(), slope.end(), 0.0);
}

}  // namespace malleus
