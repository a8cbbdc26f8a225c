#include "fem/inertia_element.hpp"

#include <numbers>

#include "fem/transport_element.hpp"

namespace malleus {

template <int D>
void InertiaElement<D>::set_masses(const SimplexPoints<D>& points, Geometry geometry) {
  if (geometry == Geometry::plane) {
    mass_.setConstant(volume_ / ((D + 1) * (D + 2)));
    mass_.diagonal() *= 2;
  } else {
    // integral of phi_a phi_b phi_c: A/60 times 1, 2 or 6 where none, two or all are the same.
    const Eigen::Matrix<Real, 1, D + 1> radius = points.row(0);
    const Real unit = 2 * std::numbers::pi * volume_ / 60;
    for (int a = 0; a <= D; ++a) {
      for (int b = 0; b <= D; ++b) {
        const Real twice = a == b ? 2 : 1;
        mass_(a, b) = unit * twice * (radius.sum() + radius[a] + radius[b]);
      }
    }
  }
  shares_ = mass_.rowwise().sum();
  volume_ = shares_.sum();
  shares_ /= volume_;
}

template <int D>
InertiaElement<D>::InertiaElement(const SimplexPoints<D>& points, Geometry geometry, const ElementInertia<D>& inertia,
                                  const Eigen::Matrix<Real, D, D + 1>& velocity, Real viscosity)
    : inertia_(inertia), velocity_(velocity) {
  constexpr Real bubble_share = 1.0 / 20.0;  // of triangles, see AxisymmetricMiniElement
  const P1Gradients<D> p1 = p1_gradients<D>(points);
  gradients_ = p1.gradients;
  volume_ = p1.volume;
  set_masses(points, geometry);
  const Point<D> mean = velocity * shares_;
  carried_ = gradients_.transpose() * mean;
  Square stiffness = gradients_ * gradients_.transpose();
  stiffness.diagonal().array() += stiffness.trace();
  const Square unit = stiffness.inverse() / viscosity;
  stokes_ = subscale_share<D> * unit;
  const Real kept = geometry == Geometry::plane ? 0 : bubble_share;
  Square inverse = viscosity / (subscale_share<D> - kept) * stiffness;
  inverse.diagonal().array() += inertia.density * (inertia.rate + 2 * streamline_rate<D>(p1, mean));
  subscale_ = inverse.inverse() + kept * unit;
}

/// r, mean over the element.
template <int D>
Point<D> InertiaElement<D>::imbalance(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load) const {
  const Point<D> acceleration = (inertia_.rate * velocity_ - inertia_.history) * shares_ + velocity_ * carried_;
  return inertia_.density * acceleration + gradients_ * unknowns.pressure - load.force * shares_;
}

template <int D>
ElementUnknowns<D> InertiaElement<D>::residual(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load) const {
  const Square slope = velocity_ * gradients_.transpose();  // d v_i / d x_j
  const Eigen::Matrix<Real, D, D + 1> acceleration = (inertia_.rate * velocity_ - inertia_.history) + slope * velocity_;
  const Point<D> imbalanced = imbalance(unknowns, load);
  const Point<D> pushed = subscale_ * imbalanced;
  ElementUnknowns<D> result;
  result.velocity = inertia_.density * (acceleration * mass_ + volume_ * pushed * carried_.transpose());
  const Point<D> change = pushed - stokes_ * (gradients_ * unknowns.pressure - load.force * shares_);
  result.pressure = -volume_ * (gradients_.transpose() * change);
  return result;
}

template <int D>
void InertiaElement<D>::add_matrix(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load, bool newton,
                                   Real scale, ElementMatrix<D>& result) const {
  const Real density = inertia_.density;
  const Square slope = velocity_ * gradients_.transpose();
  const Eigen::Matrix<Real, D + 1, D + 1> convection = mass_ * (velocity_.transpose() * gradients_);
  const Point<D> pushed = subscale_ * imbalance(unknowns, load);
  for (int b = 0; b <= D; ++b) {
    Square change = Square::Zero();  // d r / d v_b
    change.diagonal().array() += density * (inertia_.rate * shares_[b] + carried_[b]);
    if (newton) change += density * shares_[b] * slope;
    const Square subscale_change = volume_ * subscale_ * change;
    const Point<D> by_pressure = volume_ * scale * (subscale_ * gradients_.col(b));
    const Point<D> surplus = by_pressure - volume_ * scale * (stokes_ * gradients_.col(b));
    for (int a = 0; a <= D; ++a) {
      auto& block = result.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      auto viscous = block.template topLeftCorner<D, D>();
      viscous.diagonal().array() += density * (inertia_.rate * mass_(a, b) + convection(a, b));
      viscous += density * carried_[a] * subscale_change;
      if (newton) {
        viscous += density * mass_(a, b) * slope;
        viscous += density * volume_ * shares_[b] * pushed * gradients_.col(a).transpose();
      }
      block.template topRightCorner<D, 1>() += density * carried_[a] * by_pressure;
      block.template bottomLeftCorner<1, D>() -= scale * gradients_.col(a).transpose() * subscale_change;
      block(D, D) -= scale * gradients_.col(a).dot(surplus);
    }
  }
}

template <int D>
Point<D> InertiaElement<D>::subscale_velocity(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load) const {
  return -subscale_ * imbalance(unknowns, load);
}

template class InertiaElement<2>;
template class InertiaElement<3>;

}  // namespace malleus
