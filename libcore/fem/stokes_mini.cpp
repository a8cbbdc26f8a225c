#include "fem/stokes_mini.hpp"

#include <cmath>

namespace malleus {

template <int D>
MiniElement<D>::MiniElement(const SimplexPoints<D>& points) {
  const P1Gradients<D> geometry = p1_gradients<D>(points);
  gradients_ = geometry.gradients;
  volume_ = geometry.volume;
  Eigen::Matrix<Real, D, D> stiffness = gradients_ * gradients_.transpose();
  stiffness.diagonal().array() += stiffness.trace();
  subscale_ = subscale_share<D> * volume_ * stiffness.inverse();
}

template <int D>
Eigen::Matrix<Real, D, D> MiniElement<D>::strain_rate(const Eigen::Matrix<Real, D, D + 1>& velocity) const {
  const Eigen::Matrix<Real, D, D> gradient = velocity * gradients_.transpose();
  return 0.5 * (gradient + gradient.transpose());
}

template <int D>
Real MiniElement<D>::shear_rate(const Eigen::Matrix<Real, D, D + 1>& velocity) const {
  return std::sqrt(2.0) * strain_rate(velocity).norm();
}

template <int D>
ElementUnknowns<D> MiniElement<D>::residual(const ElementUnknowns<D>& unknowns, Real viscosity,
                                            Real bubble_viscosity) const {
  const Eigen::Matrix<Real, D, D> rate = strain_rate(unknowns.velocity);
  ElementUnknowns<D> result;
  Eigen::Matrix<Real, D, D> stress = 2 * viscosity * rate;
  stress.diagonal().array() -= unknowns.pressure.mean();
  result.velocity = volume_ * stress * gradients_;
  const Eigen::Matrix<Real, D, 1> slope = gradients_ * unknowns.pressure;
  result.pressure = (-1 / bubble_viscosity) * (gradients_.transpose() * (subscale_ * slope));
  result.pressure.array() -= volume_ / (D + 1) * rate.trace();
  return result;
}

template <int D>
ElementUnknowns<D> MiniElement<D>::load(const ElementLoad<D>& load, Real bubble_viscosity) const {
  const Real share = volume_ / (D + 1);
  const Eigen::Matrix<Real, D, 1> total = load.force.rowwise().sum();
  ElementUnknowns<D> result;
  // integral of phi_a phi_b: V/((D+1)(D+2)) (1 + delta_ab)
  result.velocity = share / (D + 2) * (load.force.colwise() + total);
  result.pressure = (-1 / bubble_viscosity / (D + 1)) * (gradients_.transpose() * (subscale_ * total));
  result.pressure.array() -= share * load.divergence;
  return result;
}

template <int D>
Point<D> MiniElement<D>::subscale_velocity(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load,
                                           Real viscosity) const {
  return subscale_ / (volume_ * viscosity) * (load.force.rowwise().mean() - gradients_ * unknowns.pressure);
}

template <int D>
void MiniElement<D>::matrix(const Eigen::Matrix<Real, D, D + 1>& velocity, const TangentFactors& factors,
                            ElementMatrix<D>& result) const {
  const auto [viscosity, slope, scale] = factors;
  const Eigen::Matrix<Real, D, D + 1> stress_gradients = viscosity * volume_ * gradients_;
  const Eigen::Matrix<Real, D, D + 1> coupling = -scale * volume_ / (D + 1) * gradients_;
  const Eigen::Matrix<Real, D, D + 1> subscale_gradients = (-scale * scale / viscosity) * (subscale_ * gradients_);
  Eigen::Matrix<Real, D, D + 1> rate_gradients;
  if (slope != 0) rate_gradients = 2 * volume_ * (strain_rate(velocity) * gradients_);
  for (int a = 0; a <= D; ++a) {
    for (int b = 0; b <= a; ++b) {
      auto& block = result.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      auto viscous = block.template topLeftCorner<D, D>();
      viscous.noalias() = stress_gradients.col(b) * gradients_.col(a).transpose();
      viscous.diagonal().array() += stress_gradients.col(a).dot(gradients_.col(b));
      if (slope != 0) viscous += (slope / volume_) * rate_gradients.col(a) * rate_gradients.col(b).transpose();
      block.template topRightCorner<D, 1>() = coupling.col(a);
      block.template bottomLeftCorner<1, D>() = coupling.col(b).transpose();
      block(D, D) = gradients_.col(a).dot(subscale_gradients.col(b));
      if (a != b) result.blocks[static_cast<std::size_t>(b)][static_cast<std::size_t>(a)] = block.transpose();
    }
  }
}

template <int D>
void MiniElement<D>::add_subscale_slope(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load,
                                        const TangentFactors& factors, ElementMatrix<D>& result) const {
  const auto [viscosity, slope, scale] = factors;
  const Point<D> imbalance = gradients_ * unknowns.pressure - load.force.rowwise().mean();
  const Eigen::Matrix<Real, D + 1, 1> flow =
      scale * slope / (viscosity * viscosity) * (gradients_.transpose() * (subscale_ * imbalance));
  const Eigen::Matrix<Real, D, D + 1> rate_gradients = 2 * strain_rate(unknowns.velocity) * gradients_;
  for (int a = 0; a <= D; ++a) {
    for (int b = 0; b <= D; ++b) {
      auto& block = result.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      block.template bottomLeftCorner<1, D>() += flow[a] * rate_gradients.col(b).transpose();
    }
  }
}

template <int D>
void MiniElement<D>::add_slope_product(const ElementUnknowns<D>& step, const SlopePoint<D>& at,
                                       ElementUnknowns<D>& product) const {
  const Eigen::Matrix<Real, D, D> rate = strain_rate(at.state.velocity);
  const Real work = 2 * at.slope * rate.cwiseProduct(strain_rate(step.velocity)).sum();  // d eta
  product.velocity += 2 * volume_ * work * (rate * gradients_);
  if (!at.follows_subscales) return;
  const Point<D> imbalance = gradients_ * at.state.pressure - at.force;
  product.pressure += work / (at.viscosity * at.viscosity) * (gradients_.transpose() * (subscale_ * imbalance));
}

template class MiniElement<2>;
template class MiniElement<3>;

}  // namespace malleus
