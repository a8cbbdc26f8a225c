#include "fem/inertia_element.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace malleus {
namespace {

template <int D>
SimplexPoints<D> some_points() {
  SimplexPoints<D> points = SimplexPoints<D>::Zero();
  for (int d = 0; d < D; ++d) points(d, d + 1) = 1 + 0.2 * d;
  points.array() += 0.3;
  points(0, 1) += 0.1;
  return points;
}

template <int D>
ElementUnknowns<D> some_unknowns() {
  ElementUnknowns<D> unknowns;
  for (int a = 0; a <= D; ++a) {
    for (int d = 0; d < D; ++d) unknowns.velocity(d, a) = 0.7 + 0.5 * std::sin(3.0 * a + 2 * d);
    unknowns.pressure[a] = std::cos(2.0 * a);
  }
  return unknowns;
}

template <int D>
ElementInertia<D> some_inertia() {
  ElementInertia<D> inertia;
  inertia.density = 1.7;
  inertia.rate = 0.6;
  for (int a = 0; a <= D; ++a) {
    for (int d = 0; d < D; ++d) inertia.history(d, a) = std::cos(1.0 * a - d);
  }
  return inertia;
}

/// Derivative of the residual along a direction, by the matrix less that by differences; relative.
template <int D>
Real error_along(const ElementUnknowns<D>& direction, Geometry geometry, Real viscosity) {
  const SimplexPoints<D> points = some_points<D>();
  const ElementUnknowns<D> at = some_unknowns<D>();
  const ElementLoad<D> load;
  const auto residual = [&](Real step) {
    ElementUnknowns<D> moved = at;
    moved.velocity += step * direction.velocity;
    moved.pressure += step * direction.pressure;
    return InertiaElement<D>(points, geometry, some_inertia<D>(), moved.velocity, viscosity).residual(moved, load);
  };
  constexpr Real step = 1e-5;
  const auto high = residual(step);
  const auto low = residual(-step);
  ElementMatrix<D> matrix;
  for (auto& row : matrix.blocks) {
    for (auto& block : row) block.setZero();
  }
  InertiaElement<D>(points, geometry, some_inertia<D>(), at.velocity, viscosity).add_matrix(at, load, true, 1, matrix);
  Real error = 0;
  Real size = 0;
  for (int a = 0; a <= D; ++a) {
    Eigen::Matrix<Real, D + 1, 1> by_matrix = Eigen::Matrix<Real, D + 1, 1>::Zero();
    for (int b = 0; b <= D; ++b) {
      Eigen::Matrix<Real, D + 1, 1> part;
      part << direction.velocity.col(b), direction.pressure[b];
      by_matrix += matrix.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] * part;
    }
    Eigen::Matrix<Real, D + 1, 1> by_difference;
    by_difference << (high.velocity.col(a) - low.velocity.col(a)) / (2 * step),
        (high.pressure[a] - low.pressure[a]) / (2 * step);
    error = std::max(error, (by_matrix - by_difference).norm());
    size = std::max(size, by_difference.norm());
  }
  return error / size;
}

template <int D>
void check_derivative(Geometry geometry) {
  ElementUnknowns<D> direction;
  direction.pressure = some_unknowns<D>().pressure.reverse();
  EXPECT_LT(error_along<D>(direction, geometry, 0.8), 1e-8);
  direction.pressure.setZero();
  direction.velocity = some_inertia<D>().history;
  // T_i follows the velocity, which the matrix leaves out: where viscosity rules, by little.
  EXPECT_LT(error_along<D>(direction, geometry, 1e6), 1e-5);
}

TEST(InertiaElement, MatrixIsTheDerivativeOfTheResidual) {
  check_derivative<2>(Geometry::plane);
  check_derivative<2>(Geometry::axisymmetric);
  check_derivative<3>(Geometry::plane);
}

/// Where rho dv/dt + rho v . grad v + grad p = f for linear functions, the subscales rest and the momentum balances.
template <int D>
void check_balance(Geometry geometry) {
  const SimplexPoints<D> points = some_points<D>();
  const ElementUnknowns<D> at = some_unknowns<D>();
  const ElementInertia<D> inertia = some_inertia<D>();
  const auto gradients = p1_gradients<D>(points).gradients;
  const Eigen::Matrix<Real, D, D> slope = at.velocity * gradients.transpose();
  ElementLoad<D> load;
  load.force = inertia.density * (inertia.rate * at.velocity - inertia.history + slope * at.velocity);
  const Point<D> push = gradients * at.pressure;
  const InertiaElement<D> element(points, geometry, inertia, at.velocity, 0.9);
  ElementUnknowns<D> unpressed;
  unpressed.velocity = at.velocity;
  const auto without_pressure = element.residual(unpressed, load);
  load.force.colwise() += push;
  EXPECT_LT(element.subscale_velocity(at, load).norm(), 1e-13);
  // integral of f.w without the pressure's part, exactly: by the plane element's load, or the ring's
  ElementLoad<D> moved = load;
  moved.force.colwise() -= push;
  Eigen::Matrix<Real, D, D + 1> expected;
  if constexpr (D == 2) {
    expected = geometry == Geometry::plane ? MiniElement<2>(points).load(moved, 0.9).velocity
                                           : Eigen::Matrix<Real, 2, 3>(without_pressure.velocity);
  } else {
    expected = MiniElement<D>(points).load(moved, 0.9).velocity;
  }
  EXPECT_LT((element.residual(at, load).velocity - expected).norm(), 1e-12 * expected.norm());
}

TEST(InertiaElement, ExactFlowsBalance) {
  check_balance<2>(Geometry::plane);
  check_balance<2>(Geometry::axisymmetric);
  check_balance<3>(Geometry::plane);
}

/// A ring far from the axis is a plane element times its circumference.
TEST(InertiaElement, RingsFarFromTheAxisArePlane) {
  constexpr Real far = 1e5;
  const SimplexPoints<2> points = some_points<2>();
  SimplexPoints<2> ring = points;
  ring.row(0).array() += far;
  const ElementUnknowns<2> at = some_unknowns<2>();
  const ElementInertia<2> inertia = some_inertia<2>();
  const auto plane = InertiaElement<2>(points, Geometry::plane, inertia, at.velocity, 1e6).residual(at, {});
  const auto turned = InertiaElement<2>(ring, Geometry::axisymmetric, inertia, at.velocity, 1e6).residual(at, {});
  const Real around = 2 * std::numbers::pi * far;
  EXPECT_LT((turned.velocity / around - plane.velocity).norm(), 1e-4 * plane.velocity.norm());
}

}  // namespace
}  // namespace malleus
