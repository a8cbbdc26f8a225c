#include "forge/friction.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "shapes.hpp"

namespace malleus::forge {
namespace {

NormalTerm pressing() {
  NormalTerm normal;
  normal.normal = Vector(1, 2, -2) / 3;
  normal.offset = 3;  // closing whatever the slips below are
  normal.penalty = 7;
  normal.multiplier = 2;
  return normal;
}

void expect_derivative(const NormalTerm& normal, const FrictionTerm& friction, const Vector& slip) {
  const ContactTraction traction = contact_traction(normal, friction, slip);
  const Real step = 1e-6;
  for (int i = 0; i < 3; ++i) {
    const Vector shift = step * Vector::Unit(i);
    const Vector difference = (contact_traction(normal, friction, slip + shift).traction -
                               contact_traction(normal, friction, slip - shift).traction) /
                              (2 * step);
    const Real scale = 1 + traction.derivative.norm();
    EXPECT_NEAR((difference - traction.derivative.col(i)).norm() / scale, 0, 1e-8)
        << "q " << friction.exponent << " slip " << slip.transpose();
  }
  EXPECT_NEAR((traction.derivative - traction.derivative.transpose()).norm(), 0, 1e-12 * traction.derivative.norm());
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(traction.derivative);
  EXPECT_LE(eigen.eigenvalues().maxCoeff(), 1e-12 * traction.derivative.norm());
}

TEST(ContactTraction, DerivativeMatchesFiniteDifferencesForEveryExponent) {
  for (const Real exponent : {0.0, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0}) {
    for (const Real regularisation : {0.05, 0.5}) {
      for (const Vector& slip : test::cloud(20, 1)) {
        expect_derivative(pressing(), {1.7, exponent, regularisation}, slip);
      }
      expect_derivative(pressing(), {1.7, exponent, regularisation}, Vector::Zero());
    }
  }
}

TEST(ContactTraction, PressureIsThePositivePart) {
  NormalTerm normal = pressing();
  const Vector opening = 5 * normal.normal;
  EXPECT_NEAR(contact_traction(normal, {}, opening).pressure, 0, 0);
  EXPECT_EQ(contact_traction(normal, {}, opening).traction.norm(), 0);
  EXPECT_EQ(contact_traction(normal, {}, opening).derivative.norm(), 0);
  normal.multiplier = 20;  // the augmented Lagrangian's multiplier holds it closed: 20 + 7 (3 - 5) = 6
  EXPECT_NEAR(contact_traction(normal, {}, opening).pressure, 6, 1e-12);
}

TEST(ContactTraction, NortonFrictionIsThePowerOfTheSlip) {
  const NormalTerm normal = pressing();
  const Vector tangent = Vector(2, -1, 0).normalized();
  for (const Real exponent : {0.3, 1.0, 2.0}) {
    for (const Real speed : {0.5, 1.0, 2.0}) {
      const FrictionTerm term = friction_term({FrictionLaw::norton, 0.4, exponent}, 10, 1e9, 1e9, 1e-9);
      const Vector friction = contact_traction(normal, term, speed * tangent).traction -
                              contact_traction(normal, {}, speed * tangent).traction;
      EXPECT_NEAR((friction + 0.4 * 10 * std::pow(speed, exponent) * tangent).norm(), 0, 1e-7);
    }
  }
}

TEST(ContactTraction, LimitLawsAreBoundedAndLinearBelowTheRegularisation) {
  const NormalTerm normal = pressing();
  const Vector tangent = Vector(2, -1, 0).normalized();
  const auto friction = [&](const FrictionSpec& spec, Real speed) {
    const FrictionTerm term = friction_term(spec, 10, 50, 30, 1e-3);
    return (contact_traction(normal, term, speed * tangent).traction -
            contact_traction(normal, {}, speed * tangent).traction)
        .norm();
  };
  const FrictionSpec tresca = {FrictionLaw::tresca, 0.5, 1};
  EXPECT_NEAR(friction(tresca, 1), 25, 1e-4);
  EXPECT_NEAR(friction(tresca, 1e-6), 25e-3, 1e-7);
  const FrictionSpec coulomb = {FrictionLaw::coulomb, 0.2, 1};
  EXPECT_NEAR(friction(coulomb, 1), 6, 1e-4);                        // f p
  EXPECT_NEAR(friction({FrictionLaw::coulomb, 5, 1}, 1), 50, 1e-4);  // no more than the shear stress
  EXPECT_NEAR(friction({FrictionLaw::norton, 0, 0.3}, 1), 0, 0);     // no coefficient, no friction
}

}  // namespace
}  // namespace malleus::forge
