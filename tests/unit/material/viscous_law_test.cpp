#include "material/viscous_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace malleus {
namespace {

struct Point {
  Real viscosity;
  Real slope;
};

Point at(const ViscousLaw& law, Real gamma) {
  Point point{};
  law.evaluate(std::span(&gamma, 1), std::span(&point.viscosity, 1), std::span(&point.slope, 1));
  return point;
}

struct NamedLaw {
  std::string name;
  std::unique_ptr<const ViscousLaw> law;
};

std::vector<NamedLaw> all_laws() {
  std::vector<NamedLaw> laws;
  laws.push_back({"newtonian", std::make_unique<NewtonianLaw>(3.0)});
  for (const Real m : {0.02, 0.1, 0.3, 0.5, 1.0, 1.4}) {
    laws.push_back({"norton-hoff " + std::to_string(m), std::make_unique<NortonHoffLaw>(NortonHoff{179.2e6, m, 1e-3})});
  }
  laws.push_back({"carreau", std::make_unique<CarreauYasudaLaw>(CarreauYasuda{1e4, 10, 0.3, 0.35, 2})});
  laws.push_back({"yasuda", std::make_unique<CarreauYasudaLaw>(CarreauYasuda{1e4, 0, 0.3, 0.35, 0.7})});
  laws.push_back({"cross", std::make_unique<CrossLaw>(Cross{1e4, 10, 0.3, 0.35})});
  laws.push_back({"clamped", std::make_unique<ClampedLaw>(std::make_unique<NortonHoffLaw>(NortonHoff{1000, 0.4, 1e-9}),
                                                          50, 1500)});
  return laws;
}

TEST(ViscousLaws, SlopeIsTheDerivativeOverTheRate) {
  for (const auto& [name, law] : all_laws()) {
    for (Real gamma = 1e-5; gamma < 1e5; gamma *= 7) {
      const Real h = 1e-5 * gamma;
      const Real difference = (at(*law, gamma + h).viscosity - at(*law, gamma - h).viscosity) / (2 * h);
      const Point point = at(*law, gamma);
      EXPECT_NEAR(point.slope * gamma * gamma / point.viscosity, difference * gamma / point.viscosity, 1e-8)
          << name << " at " << gamma;
    }
  }
}

TEST(ViscousLaws, StressGrowsWithTheRateAtLeastAsTheSensitivity) {
  for (const auto& [name, law] : all_laws()) {
    for (Real gamma = 1e-5; gamma < 1e5; gamma *= 7) {
      const Point point = at(*law, gamma);
      const Real exponent = 1 + point.slope * gamma * gamma / point.viscosity;
      EXPECT_GE(exponent, law->sensitivity() - 1e-12) << name << " at " << gamma;
    }
  }
}

TEST(ViscousLaws, AreFiniteAtRest) {
  for (const auto& [name, law] : all_laws()) {
    const Point point = at(*law, 0);
    EXPECT_TRUE(std::isfinite(point.viscosity) && point.viscosity > 0) << name;
    EXPECT_TRUE(std::isfinite(point.slope)) << name;
  }
}

TEST(ViscousLaws, NortonHoffFollowsItsFormula) {
  // eta = K (sqrt(3) e)^(m-1); uniaxial stress sqrt(3) K (sqrt(3) e)^m: 3 eta e.
  const NortonHoffLaw law({179.2e6, 0.3, 0});
  const Real e = 0.7;
  const Real gamma = std::sqrt(3.0) * e;
  EXPECT_NEAR(3 * at(law, gamma).viscosity * e / (std::sqrt(3.0) * 179.2e6 * std::pow(gamma, 0.3)), 1, 1e-14);
  // the cut-off changes the viscosity at gamma = 100 gamma_0 by (1-m)/2 1e-4
  const NortonHoffLaw regularised({179.2e6, 0.3, 0.01 * gamma});
  EXPECT_NEAR(1 - at(regularised, gamma).viscosity / at(law, gamma).viscosity, 0.35e-4, 1e-8);
  EXPECT_NEAR(at(regularised, 0).viscosity, 179.2e6 * std::pow(0.01 * gamma, -0.7), 1);
  EXPECT_TRUE(NortonHoffLaw({1, 1, 0}).is_linear());
  EXPECT_FALSE(law.is_linear());
  EXPECT_FALSE(NortonHoffLaw({1, 1.4, 0}).is_linear());
}

TEST(ViscousLaws, CarreauYasudaAndCrossHaveTheirLimits) {
  const CarreauYasudaLaw carreau({1e4, 10, 0.3, 0.35, 2});
  EXPECT_NEAR(at(carreau, 1e-6).viscosity, 1e4, 1e-6);
  EXPECT_NEAR(at(carreau, 1 / 0.3).viscosity, 10 + 9990 * std::pow(2, -0.325), 1e-9);
  EXPECT_NEAR((at(carreau, 1e8).viscosity - 10) / (9990 * std::pow(0.3e8, -0.65)), 1, 1e-10);
  const CrossLaw cross({1e4, 10, 0.3, 0.35});
  EXPECT_NEAR(at(cross, 0).viscosity, 1e4, 1e-3);
  EXPECT_NEAR(at(cross, 1 / 0.3).viscosity, 10 + 9990 / 2.0, 1e-9);
}

TEST(ViscousLaws, ClampHoldsTheLimits) {
  const ClampedLaw law(std::make_unique<NortonHoffLaw>(NortonHoff{1000, 0.4, 1e-9}), 50, 1500);
  EXPECT_EQ(at(law, 1e-6).viscosity, 1500);
  EXPECT_EQ(at(law, 1e-6).slope, 0);
  EXPECT_EQ(at(law, 1e6).viscosity, 50);
  EXPECT_NEAR(at(law, 2).viscosity, 1000 * std::pow(2, -0.6), 1e-9);
}

}  // namespace
}  // namespace malleus
