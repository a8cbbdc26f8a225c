#include "fem/stokes_mini.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "fem/quadrature.hpp"

namespace malleus {
namespace {

/// Repeatable numbers in (-1, 1).
class Numbers {
 public:
  Real operator()() { return distribution_(engine_); }

 private:
  std::mt19937 engine_{12345};
  std::uniform_real_distribution<Real> distribution_{-1, 1};
};

template <int D>
SimplexPoints<D> skew_simplex() {
  SimplexPoints<D> points = SimplexPoints<D>::Zero();
  points.template rightCols<D>().setIdentity();
  Numbers number;
  for (int i = 0; i < points.size(); ++i) points(i) += 0.2 * number() + 0.5;
  return points;
}

template <int D>
ElementUnknowns<D> some_unknowns() {
  Numbers number;
  ElementUnknowns<D> unknowns;
  for (int i = 0; i < unknowns.velocity.size(); ++i) unknowns.velocity(i) = number();
  for (int i = 0; i < unknowns.pressure.size(); ++i) unknowns.pressure(i) = number();
  return unknowns;
}

template <int D>
Real largest_difference(const ElementUnknowns<D>& a, const ElementUnknowns<D>& b) {
  return std::max((a.velocity - b.velocity).cwiseAbs().maxCoeff(), (a.pressure - b.pressure).cwiseAbs().maxCoeff());
}

template <int D>
ElementUnknowns<D> multiply(const ElementMatrix<D>& matrix, const ElementUnknowns<D>& x) {
  ElementUnknowns<D> result;
  for (std::size_t a = 0; a <= D; ++a) {
    for (std::size_t b = 0; b <= D; ++b) {
      Eigen::Matrix<Real, D + 1, 1> node;
      node << x.velocity.col(static_cast<int>(b)), x.pressure[static_cast<int>(b)];
      const Eigen::Matrix<Real, D + 1, 1> y = matrix.blocks[a][b] * node;
      result.velocity.col(static_cast<int>(a)) += y.template head<D>();
      result.pressure[static_cast<int>(a)] += y[D];
    }
  }
  return result;
}

template <int D>
Real asymmetry(const ElementMatrix<D>& matrix) {
  Real largest = 0;
  for (std::size_t a = 0; a <= D; ++a) {
    for (std::size_t b = 0; b <= D; ++b) {
      largest = std::max(largest, (matrix.blocks[a][b] - matrix.blocks[b][a].transpose()).cwiseAbs().maxCoeff());
    }
  }
  return largest;
}

/// A law with eta = gamma^-0.6 and its slope.
Real thinning(Real gamma) {
  return std::pow(gamma, -0.6);
}
Real thinning_slope(Real gamma) {
  return -0.6 * std::pow(gamma, -2.6);
}

template <class Element>
class StokesElement : public testing::Test {};
using Elements = testing::Types<MiniElement<2>, MiniElement<3>, AxisymmetricMiniElement>;
TYPED_TEST_SUITE(StokesElement, Elements);

TYPED_TEST(StokesElement, MatrixTimesUnknownsIsTheResidual) {
  constexpr int D = TypeParam::dim;
  const TypeParam element(skew_simplex<D>());
  const auto x = some_unknowns<D>();
  ElementMatrix<D> matrix;
  element.matrix(x.velocity, {3.0, 0, 1}, matrix);
  EXPECT_LT(largest_difference(multiply(matrix, x), element.residual(x, 3.0, 3.0)), 1e-13);
  EXPECT_LT(asymmetry(matrix), 1e-14);
}

TYPED_TEST(StokesElement, ScaleMultipliesRowsAndColumnsOfThePressure) {
  constexpr int D = TypeParam::dim;
  const TypeParam element(skew_simplex<D>());
  const auto x = some_unknowns<D>();
  ElementMatrix<D> plain;
  ElementMatrix<D> scaled;
  element.matrix(x.velocity, {3.0, 0, 1}, plain);
  element.matrix(x.velocity, {3.0, 0, 7}, scaled);
  auto seventh = x;
  seventh.pressure /= 7;
  auto product = multiply(scaled, seventh);
  product.pressure /= 7;
  EXPECT_LT(largest_difference(product, multiply(plain, x)), 1e-13);
}

/// The derivative by differences against the matrix times each unit velocity. without_subscales: T stays as it is.
template <class Element>
Real tangent_error(bool without_subscales) {
  constexpr int D = Element::dim;
  const Element element(skew_simplex<D>());
  const auto x = some_unknowns<D>();
  ElementLoad<D> load;
  load.force = 0.3 * x.velocity.array().square() + 1;
  const Real gamma = element.shear_rate(x.velocity);
  const TangentFactors factors{thinning(gamma), thinning_slope(gamma), 3};
  ElementMatrix<D> tangent;
  element.matrix(x.velocity, factors, tangent);
  if (without_subscales) {
    EXPECT_LT(asymmetry(tangent), 1e-13);
  } else {
    element.add_subscale_slope(x, load, factors, tangent);
  }
  const auto at = [&](Real factor, const ElementUnknowns<D>& direction) {
    auto moved = x;
    moved.velocity += factor * direction.velocity;
    const Real viscosity = thinning(element.shear_rate(moved.velocity));
    const Real of_subscales = without_subscales ? thinning(gamma) : viscosity;
    ElementUnknowns<D> result = element.residual(moved, viscosity, of_subscales);
    result.pressure = factors.scale * (result.pressure - element.load(load, of_subscales).pressure);
    return result;
  };
  Real largest = 0;
  for (int k = 0; k < D * (D + 1); ++k) {
    ElementUnknowns<D> direction;
    direction.velocity(k) = 1;
    const Real h = 1e-5;
    auto difference = at(h, direction);
    const auto below = at(-h, direction);
    difference.velocity = (difference.velocity - below.velocity) / (2 * h);
    difference.pressure = (difference.pressure - below.pressure) / (2 * h);
    largest = std::max(largest, largest_difference(difference, multiply(tangent, direction)));
  }
  return largest;
}

TYPED_TEST(StokesElement, TangentIsTheDerivativeOfTheResidual) {
  EXPECT_LT(tangent_error<TypeParam>(true), 1e-8);
  EXPECT_LT(tangent_error<TypeParam>(false), 1e-8);
}

TYPED_TEST(StokesElement, CompressibilityOfTheBubbleIsPositive) {
  constexpr int D = TypeParam::dim;
  const TypeParam element(skew_simplex<D>());
  ElementMatrix<D> matrix;
  element.matrix(some_unknowns<D>().velocity, {2.0, 0, 1}, matrix);
  Eigen::Matrix<Real, D + 1, D + 1> c;
  for (int a = 0; a <= D; ++a) {
    for (int b = 0; b <= D; ++b)
      c(a, b) = -matrix.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)](D, D);
  }
  const auto values = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<Real, D + 1, D + 1>>(c).eigenvalues().eval();
  EXPECT_GT(values[0], -1e-14);
  EXPECT_GT(values[1], 1e-6);
}

TYPED_TEST(StokesElement, HydrostaticPressureBalancesAUniformForce) {
  constexpr int D = TypeParam::dim;
  // The P1 pressure of a uniform force solves the condensed equations of each element but for its boundary.
  const SimplexPoints<D> points = skew_simplex<D>();
  const TypeParam element(points);
  ElementLoad<D> load;
  ElementUnknowns<D> x;
  Point<D> force = Point<D>::Constant(0.7);
  force[0] = D == 2 ? 0 : -0.4;
  load.force.colwise() += force;
  x.pressure = points.transpose() * force;
  const auto residual = element.residual(x, 5.0, 5.0);
  const auto against = element.load(load, 5.0);
  EXPECT_LT((residual.pressure - against.pressure).cwiseAbs().maxCoeff(), 1e-13);
}

template <class Element>
class PlaneElement : public testing::Test {};
using PlaneElements = testing::Types<MiniElement<2>, MiniElement<3>>;
TYPED_TEST_SUITE(PlaneElement, PlaneElements);

/// A simplex with equal edges of length 1, on a face of it y = 0 (z = 0 in space).
template <int D>
SimplexPoints<D> regular_simplex() {
  SimplexPoints<D> points;
  if constexpr (D == 2) {
    points << 0, 1, 0.5, 0, 0, std::sqrt(0.75);
  } else {
    const Real third = std::sqrt(1.0 / 12.0);
    points << 0, 1, 0.5, 0.5, 0, 0, std::sqrt(0.75), third, 0, 0, 0, std::sqrt(2.0 / 3.0);
  }
  return points;
}

/// T = d^2 / (12 eta), d the height: what linear functions lose of the flow between parallel plates in a layer.
TYPED_TEST(PlaneElement, SubscalesCarryWhatALayerLosesOfAChannelsFlow) {
  constexpr int D = TypeParam::dim;
  const SimplexPoints<D> points = regular_simplex<D>();
  const P1Gradients<D> geometry = p1_gradients<D>(points);
  const Real height = 1 / geometry.gradients.col(0).norm();
  const Real viscosity = 3;
  ElementMatrix<D> matrix;
  TypeParam(points).matrix(Eigen::Matrix<Real, D, D + 1>::Zero(), {viscosity, 0, 1}, matrix);
  ElementUnknowns<D> unknowns;
  unknowns.pressure = points.row(0).transpose();
  const Point<D> carried = TypeParam(points).subscale_velocity(unknowns, {}, viscosity);
  EXPECT_LT((carried + height * height / (12 * viscosity) * Point<D>::Unit(0)).norm(), 1e-14);
  const Real share = geometry.volume * height * height / (12 * viscosity);
  for (int a = 0; a <= D; ++a) {
    for (int b = 0; b <= D; ++b) {
      const Real c = share * geometry.gradients.col(a).dot(geometry.gradients.col(b));
      EXPECT_NEAR(-matrix.blocks[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)](D, D), c, 1e-14);
    }
  }
}

/// In hydrostatic equilibrium (grad p = f) nothing flows, on any element.
TYPED_TEST(PlaneElement, SubscalesRestInHydrostaticEquilibrium) {
  constexpr int D = TypeParam::dim;
  const SimplexPoints<D> points = skew_simplex<D>();
  const Point<D> force = Point<D>::LinSpaced(D, 1, 3);
  ElementUnknowns<D> unknowns;
  unknowns.pressure = points.transpose() * force;
  ElementLoad<D> load;
  load.force.colwise() = force;
  const TypeParam element(points);
  const Eigen::Matrix<Real, D + 1, 1> balance =
      element.residual(unknowns, 2, 2).pressure - element.load(load, 2).pressure;
  EXPECT_LT(balance.norm(), 1e-14);
  EXPECT_LT(element.subscale_velocity(unknowns, load, 2).norm(), 1e-14);
  EXPECT_GT(element.load(load, 2).pressure.norm(), 1e-4);
}

TYPED_TEST(PlaneElement, ShearRateOfKnownMotions) {
  constexpr int D = TypeParam::dim;
  const SimplexPoints<D> points = skew_simplex<D>();
  const TypeParam element(points);
  Eigen::Matrix<Real, D, D> gradient = Eigen::Matrix<Real, D, D>::Zero();
  gradient(0, 1) = 3;  // simple shear
  EXPECT_NEAR(element.shear_rate(gradient * points), 3, 1e-13);
  gradient(1, 0) = -3;  // rotation
  EXPECT_NEAR(element.shear_rate(gradient * points), 0, 1e-13);
  EXPECT_NEAR(element.shear_rate((gradient * points).colwise() + Point<D>::Constant(1e3)), 0, 1e-11);
}

TYPED_TEST(PlaneElement, TurnedElementGivesTurnedForces) {
  constexpr int D = TypeParam::dim;
  Eigen::Matrix<Real, D, D> turn = Eigen::Matrix<Real, D, D>::Identity();
  turn.template topLeftCorner<2, 2>() = Eigen::Rotation2D<Real>(0.7).toRotationMatrix();
  if constexpr (D == 3) turn = Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  const SimplexPoints<D> points = skew_simplex<D>();
  const auto x = some_unknowns<D>();
  auto turned = x;
  turned.velocity = turn * x.velocity;
  auto expected = TypeParam(points).residual(x, 2, 2);
  expected.velocity = turn * expected.velocity;
  EXPECT_LT(largest_difference(TypeParam(SimplexPoints<D>(turn * points)).residual(turned, 2, 2), expected), 1e-13);
}

TEST(AxisymmetricElement, RingHasPappusVolume) {
  const SimplexPoints<2> points = skew_simplex<2>();
  const Real expected = 2 * std::numbers::pi * points.row(0).mean() * simplex_volume<2>(points);
  EXPECT_NEAR(AxisymmetricMiniElement(points).volume(), expected, 1e-12);
}

TEST(AxisymmetricElement, UniformCompressionHasNoBubbleAndItsShearRate) {
  SimplexPoints<2> points = skew_simplex<2>();
  for (const bool on_axis : {false, true}) {
    if (on_axis) points(0, 0) = points(0, 2) = 0;  // an edge on the axis
    if (simplex_volume<2>(points) < 0) points.col(0).swap(points.col(1));
    Eigen::Matrix<Real, 2, 3> velocity = 0.5 * points;
    velocity.row(1) = -points.row(1);
    EXPECT_NEAR(AxisymmetricMiniElement(points).shear_rate(velocity), std::sqrt(3.0), 1e-12);
    ElementUnknowns<2> x;
    x.velocity = velocity;
    EXPECT_LT(AxisymmetricMiniElement(points).residual(x, 1, 1).pressure.cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(Quadrature, IsExactForPolynomials) {
  // integral of x^2 y over the unit triangle = 2! 1! / 5!; of x y z^2 over the unit tetrahedron = 2 / 7!
  Real triangle = 0;
  for (const auto& [phi, weight] : simplex_quadrature<2>(2)) triangle += 0.5 * weight * phi[1] * phi[1] * phi[2];
  EXPECT_NEAR(triangle, 2.0 / 120, 1e-15);
  Real tetrahedron = 0;
  for (const auto& [phi, weight] : simplex_quadrature<3>(3)) {
    tetrahedron += weight / 6 * phi[1] * phi[2] * phi[3] * phi[3];
  }
  EXPECT_NEAR(tetrahedron, 2.0 / 5040, 1e-16);
}

}  // namespace
}  // namespace malleus
