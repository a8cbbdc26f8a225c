#include <cmath>
#include <numbers>

#include "fem/quadrature.hpp"
#include "fem/stokes_mini.hpp"

namespace malleus {

namespace {

using Gradients = Eigen::Matrix<Real, 2, 3>;

/// Rates of the components of a vector function f e_r or f e_z, as a column (rr, zz, theta theta, sqrt(2) rz), so that
/// eps:eps is the dot product.
Eigen::Matrix<Real, 4, 2> rates(const Eigen::Matrix<Real, 2, 1>& gradient, Real value, Real radius) {
  Eigen::Matrix<Real, 4, 2> result;
  const Real half = std::sqrt(0.5);
  result << gradient[0], 0, 0, gradient[1], value / radius, 0, half * gradient[1], half * gradient[0];
  return result;
}

/// Integrals of one element over the ring before the bubble is eliminated; viscosity 1.
struct RingIntegrals {
  Eigen::Matrix<Real, 6, 6> stiffness = Eigen::Matrix<Real, 6, 6>::Zero();          ///< P1, P1
  Eigen::Matrix<Real, 2, 6> crossing = Eigen::Matrix<Real, 2, 6>::Zero();           ///< bubble, P1
  Eigen::Matrix<Real, 2, 2> bubble = Eigen::Matrix<Real, 2, 2>::Zero();             ///< bubble, bubble
  Eigen::Matrix<Real, 3, 6> divergence = Eigen::Matrix<Real, 3, 6>::Zero();         ///< -(q, div v)
  Eigen::Matrix<Real, 3, 2> bubble_divergence = Eigen::Matrix<Real, 3, 2>::Zero();  ///< -(q, div b)
  Eigen::Matrix<Real, 3, 3> mass = Eigen::Matrix<Real, 3, 3>::Zero();
  Eigen::Matrix<Real, 3, 1> bubble_mass = Eigen::Matrix<Real, 3, 1>::Zero();
  Real volume = 0;

  void add(const Eigen::Matrix<Real, 3, 1>& phi, const Gradients& gradients, Real radius, Real weight);
};

void RingIntegrals::add(const Eigen::Matrix<Real, 3, 1>& phi, const Gradients& gradients, Real radius, Real weight) {
  const Real bubble_value = 27 * phi[0] * phi[1] * phi[2];
  const Eigen::Matrix<Real, 2, 1> bubble_gradient =
      27 *
      (phi[1] * phi[2] * gradients.col(0) + phi[2] * phi[0] * gradients.col(1) + phi[0] * phi[1] * gradients.col(2));
  Eigen::Matrix<Real, 4, 6> linear;
  for (int a = 0; a < 3; ++a) linear.middleCols<2>(2 * a) = rates(gradients.col(a), phi[a], radius);
  const Eigen::Matrix<Real, 4, 2> curved = rates(bubble_gradient, bubble_value, radius);
  stiffness += 2 * weight * linear.transpose() * linear;
  crossing += 2 * weight * curved.transpose() * linear;
  bubble += 2 * weight * curved.transpose() * curved;
  divergence -= weight * phi * linear.topRows<3>().colwise().sum();
  bubble_divergence -= weight * phi * curved.topRows<3>().colwise().sum();
  mass += weight * phi * phi.transpose();
  bubble_mass += weight * bubble_value * phi;
  volume += weight;
}

/// Acts on the components (r, z) of three vertices as `scalar` does on each.
template <int Rows>
Eigen::Matrix<Real, 2 * Rows, 6> by_component(const Eigen::Matrix<Real, Rows, 3>& scalar) {
  Eigen::Matrix<Real, 2 * Rows, 6> result = Eigen::Matrix<Real, 2 * Rows, 6>::Zero();
  for (int a = 0; a < Rows; ++a) {
    for (int b = 0; b < 3; ++b) result(2 * a, 2 * b) = result(2 * a + 1, 2 * b + 1) = scalar(a, b);
  }
  return result;
}

/// T of the subscales for eta = 1 without the bubble's part, m^2.
Eigen::Matrix<Real, 2, 2> beyond_the_bubble(const Gradients& gradients) {
  constexpr Real bubble_share = 1.0 / 20.0;
  Eigen::Matrix<Real, 2, 2> stiffness = gradients * gradients.transpose();
  stiffness.diagonal().array() += stiffness.trace();
  return (subscale_share<2> - bubble_share) * stiffness.inverse();
}

}  // namespace

AxisymmetricMiniElement::AxisymmetricMiniElement(const SimplexPoints<2>& points) {
  static const std::vector<QuadraturePoint<2>> rule = simplex_quadrature<2>(4);
  const P1Gradients<2> geometry = p1_gradients<2>(points);
  RingIntegrals ring;
  for (const auto& [phi, share] : rule) {
    const Real radius = points.row(0).dot(phi);
    ring.add(phi, geometry.gradients, radius, 2 * std::numbers::pi * radius * share * geometry.volume);
  }
  const Eigen::Matrix<Real, 2, 2> inverse = ring.bubble.inverse();
  stiffness_ = ring.stiffness - ring.crossing.transpose() * inverse * ring.crossing;
  divergence_ = ring.divergence - ring.bubble_divergence * inverse * ring.crossing;
  compliance_ = ring.bubble_divergence * inverse * ring.bubble_divergence.transpose();
  const Eigen::Matrix<Real, 3, 2> beyond = -geometry.gradients.transpose() * beyond_the_bubble(geometry.gradients);
  compliance_ -= ring.volume * beyond * geometry.gradients;
  const Eigen::Matrix<Real, 2, 6> bubble_force = by_component<1>(ring.bubble_mass.transpose());
  force_load_ = by_component<3>(ring.mass) - ring.crossing.transpose() * inverse * bubble_force;
  ring_ = ring.mass.rowwise().sum();
  bubble_load_ = ring.bubble_divergence * inverse * bubble_force - beyond * by_component<1>(ring_.transpose());
  volume_ = ring.volume;
}

Real AxisymmetricMiniElement::shear_rate(const Eigen::Matrix<Real, 2, 3>& velocity) const {
  const Eigen::Map<const Velocity> v(velocity.data());
  return std::sqrt(std::max<Real>(0, v.dot(stiffness_ * v)) / volume_);
}

ElementUnknowns<2> AxisymmetricMiniElement::residual(const ElementUnknowns<2>& unknowns, Real viscosity,
                                                     Real bubble_viscosity) const {
  const Eigen::Map<const Velocity> v(unknowns.velocity.data());
  const Velocity force = viscosity * (stiffness_ * v) + divergence_.transpose() * unknowns.pressure;
  ElementUnknowns<2> result;
  result.velocity = Eigen::Map<const Eigen::Matrix<Real, 2, 3>>(force.data());
  result.pressure = divergence_ * v - compliance_ * unknowns.pressure / bubble_viscosity;
  return result;
}

ElementUnknowns<2> AxisymmetricMiniElement::load(const ElementLoad<2>& load, Real bubble_viscosity) const {
  const Eigen::Map<const Velocity> density(load.force.data());
  const Velocity force = force_load_ * density;
  ElementUnknowns<2> result;
  result.velocity = Eigen::Map<const Eigen::Matrix<Real, 2, 3>>(force.data());
  result.pressure = -bubble_load_ * density / bubble_viscosity - load.divergence * ring_;
  return result;
}

void AxisymmetricMiniElement::matrix(const Eigen::Matrix<Real, 2, 3>& velocity, const TangentFactors& factors,
                                     ElementMatrix<2>& result) const {
  const Eigen::Map<const Velocity> v(velocity.data());
  const auto [viscosity, slope, scale] = factors;
  Eigen::Matrix<Real, 6, 6> viscous = viscosity * stiffness_;
  if (slope != 0) {
    const Velocity force = stiffness_ * v;
    viscous += slope / volume_ * force * force.transpose();
  }
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      auto& block = result.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      block.topLeftCorner<2, 2>() = viscous.block<2, 2>(2 * a, 2 * b);
      block.bottomLeftCorner<1, 2>() = scale * divergence_.block<1, 2>(a, 2 * b);
      block.topRightCorner<2, 1>() = scale * divergence_.block<1, 2>(b, 2 * a).transpose();
      block(2, 2) = -scale * scale / viscosity * compliance_(a, b);
    }
  }
}

void AxisymmetricMiniElement::add_subscale_slope(const ElementUnknowns<2>& unknowns, const ElementLoad<2>& load,
                                                 const TangentFactors& factors, ElementMatrix<2>& result) const {
  const auto [viscosity, slope, scale] = factors;
  const Eigen::Map<const Velocity> v(unknowns.velocity.data());
  const Eigen::Map<const Velocity> density(load.force.data());
  const Eigen::Matrix<Real, 3, 1> flow =
      scale * slope / (viscosity * viscosity) * (compliance_ * unknowns.pressure - bubble_load_ * density);
  const Velocity rate_gradients = stiffness_ * v / volume_;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      auto& block = result.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      block.bottomLeftCorner<1, 2>() += flow[a] * rate_gradients.segment<2>(2 * b).transpose();
    }
  }
}

}  // namespace malleus
