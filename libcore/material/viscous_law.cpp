#include "material/viscous_law.hpp"

#include <cmath>

namespace malleus {

namespace {

/// The shear rate below which x^p is taken at this rate instead: keeps x^(a-2) finite at rest.
constexpr Real smallest_argument = 1e-12;

}  // namespace

void NewtonianLaw::evaluate(std::span<const Real>, std::span<Real> viscosity, std::span<Real> slope) const {
  std::fill(viscosity.begin(), viscosity.end(), viscosity_);
  std::fill(slope.begin(), slope.end(), 0.0);
}

void NortonHoffLaw::evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const {
  const auto [consistency, sensitivity, cut_off] = constants_;
  for (std::size_t i = 0; i < shear_rate.size(); ++i) {
    // d eta / d gamma = (m-1) gamma eta / (gamma^2 + gamma_0^2)
    const Real square = std::max(shear_rate[i] * shear_rate[i] + cut_off * cut_off, 1e-200);
    viscosity[i] = sensitivity == 1 ? consistency : consistency * std::pow(square, 0.5 * (sensitivity - 1));
    slope[i] = sensitivity == 1 ? 0 : (sensitivity - 1) * viscosity[i] / square;
  }
}

void CarreauYasudaLaw::evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity,
                                std::span<Real> slope) const {
  const auto [zero, infinite, time, n, a] = constants_;
  for (std::size_t i = 0; i < shear_rate.size(); ++i) {
    const Real x = std::max(time * shear_rate[i], smallest_argument);
    const Real power = std::pow(x, a);
    const Real thinning = (zero - infinite) * std::pow(1 + power, (n - 1) / a);
    viscosity[i] = infinite + thinning;
    // d eta / d x = (n-1) thinning x^(a-1) / (1 + x^a), x = lambda gamma
    slope[i] = (n - 1) * thinning * power / ((1 + power) * x * x) * time * time;
  }
}

void CrossLaw::evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const {
  const auto [zero, infinite, time, n] = constants_;
  for (std::size_t i = 0; i < shear_rate.size(); ++i) {
    const Real x = std::max(time * shear_rate[i], smallest_argument);
    const Real power = std::pow(x, 1 - n);
    const Real thinning = (zero - infinite) / (1 + power);
    viscosity[i] = infinite + thinning;
    // d eta / d x = -(1-n) thinning x^(-n) / (1 + x^(1-n))
    slope[i] = -(1 - n) * thinning * power / ((1 + power) * x * x) * time * time;
  }
}

void ClampedLaw::evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const {
  law_->evaluate(shear_rate, viscosity, slope);
  for (std::size_t i = 0; i < viscosity.size(); ++i) {
    if (viscosity[i] >= low_ && viscosity[i] <= high_) continue;
    viscosity[i] = std::clamp(viscosity[i], low_, high_);
    slope[i] = 0;
  }
}

}  // namespace malleus
