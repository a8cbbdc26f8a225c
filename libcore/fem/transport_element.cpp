#include "fem/transport_element.hpp"

#include <cmath>

namespace malleus {

template <int D>
Real streamline_rate(const P1Gradients<D>& p1, const Point<D>& velocity) {
  return (p1.gradients.transpose() * velocity).cwiseMax(0).sum();
}

Real stabilization_time(Stabilization kind, Real rate, Real dt) {
  if (kind == Stabilization::transient) return 0.5 / std::hypot(1 / dt, rate);
  // tau multiplies squares of v . grad N: where nothing moves it is worth nothing, however large.
  return rate > 0 ? 1 / (3 * rate) : 0;
}

template <int D>
TransportElement<D> transport_element(const P1Gradients<D>& p1, const Eigen::Matrix<Real, D, D + 1>& velocities,
                                      Stabilization kind, Real dt) {
  using Matrix = Eigen::Matrix<Real, D + 1, D + 1>;
  using Vector = Eigen::Matrix<Real, D + 1, 1>;
  const Point<D> mean = velocities.rowwise().mean();
  const Real tau = stabilization_time(kind, streamline_rate<D>(p1, mean), dt);
  const Vector slope = p1.gradients.transpose() * mean;  // v . grad N_i
  // int N_i N_j = V (1 + delta_ij) / ((D+1)(D+2)); int N_i = V / (D+1).
  const Real product = p1.volume / ((D + 1) * (D + 2));
  TransportElement<D> element;
  element.mass = Matrix::Constant(product);
  element.mass.diagonal().array() += product;
  // int N_i v . grad N_j with v = sum_k N_k v_k.
  element.convection = element.mass * velocities.transpose() * p1.gradients;
  element.mass += (tau * p1.volume / (D + 1)) * slope * Vector::Ones().transpose();
  element.convection += (tau * p1.volume) * slope * slope.transpose();
  return element;
}

template Real streamline_rate<2>(const P1Gradients<2>&, const Point<2>&);
template Real streamline_rate<3>(const P1Gradients<3>&, const Point<3>&);
template TransportElement<2> transport_element<2>(const P1Gradients<2>&, const Eigen::Matrix<Real, 2, 3>&,
                                                  Stabilization, Real);
template TransportElement<3> transport_element<3>(const P1Gradients<3>&, const Eigen::Matrix<Real, 3, 4>&,
                                                  Stabilization, Real);

}  // namespace malleus
