#include "inject/mixture.hpp"

#include <gtest/gtest.h>

#include "cavity.hpp"

namespace malleus::inject {
namespace {

TEST(Share, FollowsEachLaw) {
  const std::vector<Real> values = {1, -1, -1};  // a quarter of the triangle is inside; the mean is -1/3
  EXPECT_DOUBLE_EQ(share_of(MixtureLaw::fraction, values, 1, 1), 0.25);
  EXPECT_DOUBLE_EQ(share_of(MixtureLaw::harmonic, values, 1, 1), 0.25);
  EXPECT_EQ(share_of(MixtureLaw::sharp, values, 1, 1), 0);
  // Paper, eq. [10]: 1/2 + alpha / (2 e), e = thickness times size.
  EXPECT_DOUBLE_EQ(share_of(MixtureLaw::heaviside, values, 2, 1), 0.5 - 1.0 / 12);
  EXPECT_EQ(share_of(MixtureLaw::heaviside, values, 0.1, 1), 0);
  const std::vector<Real> opposite = {-1, 1, 1};
  for (const auto law : {MixtureLaw::fraction, MixtureLaw::heaviside, MixtureLaw::sharp, MixtureLaw::harmonic}) {
    EXPECT_DOUBLE_EQ(share_of(law, values, 1, 0.7) + share_of(law, opposite, 1, 0.7), 1);
  }
}

TEST(Mix, IsTheArithmeticOrTheHarmonicMean) {
  const std::vector<Real> shares = {0.25, 0.75};
  const std::vector<MixedViscosity> fluids = {{8, 0}, {2, 0}};
  EXPECT_DOUBLE_EQ(mix(MixtureLaw::fraction, shares, fluids).viscosity, 3.5);
  EXPECT_DOUBLE_EQ(mix(MixtureLaw::harmonic, shares, fluids).viscosity, 1 / (0.25 / 8 + 0.75 / 2));
}

TEST(Mix, GivesTheDerivativeOfTheMixture) {
  // eta_k = a_k gamma^2 + b_k: slope = 2 a_k.
  const std::vector<Real> shares = {0.3, 0.7};
  const auto fluids_at = [](Real gamma) {
    return std::vector<MixedViscosity>{{5 * gamma * gamma + 1, 10}, {0.5 * gamma * gamma + 7, 1}};
  };
  constexpr Real gamma = 1.7, step = 1e-5;
  for (const auto law : {MixtureLaw::fraction, MixtureLaw::harmonic}) {
    const Real ahead = mix(law, shares, fluids_at(gamma + step)).viscosity;
    const Real behind = mix(law, shares, fluids_at(gamma - step)).viscosity;
    const Real slope = mix(law, shares, fluids_at(gamma)).slope;
    EXPECT_NEAR(slope * gamma, (ahead - behind) / (2 * step), 1e-7);
  }
}

std::vector<Fluid> three_fluids() {
  std::vector<Fluid> fluids(3);
  for (std::size_t k = 0; k < 3; ++k) {
    fluids[k].law = std::make_unique<NewtonianLaw>(std::pow(10.0, static_cast<Real>(k)));
    fluids[k].density = 100.0 * static_cast<Real>(k + 1);
  }
  return fluids;
}

TEST(Mixture, FillsTheRestWithTheBackgroundAndScalesOverlaps) {
  const Mesh mesh = test::box(2, 4, 2);
  const std::vector<Real> everywhere(static_cast<std::size_t>(mesh.nodes()), 1);
  const std::vector<Real> nowhere(everywhere.size(), -1);
  Mixture mixture(three_fluids(), 2, MixtureLaw::fraction, 1);
  mixture.update(mesh, {{0, nowhere}, {1, nowhere}});
  for (const Real share : mixture.shares(2)) EXPECT_EQ(share, 1);
  mixture.update(mesh, {{0, everywhere}, {1, everywhere}});
  std::vector<Real> rate(static_cast<std::size_t>(mesh.elements()), 1), viscosity(rate.size()), slope(rate.size());
  mixture.evaluate(mesh, rate, viscosity, slope);
  for (std::size_t e = 0; e < rate.size(); ++e) {
    EXPECT_DOUBLE_EQ(mixture.shares(0)[e], 0.5);
    EXPECT_DOUBLE_EQ(viscosity[e], 0.5 * 1 + 0.5 * 10);
    EXPECT_DOUBLE_EQ(mixture.density(static_cast<LocalId>(e)), 150);
  }
}

TEST(Fluids, AreThickenedToTheAllowedContrast) {
  InjectCase settings = test::box_case(2, WallSettings::Condition::slip);
  EXPECT_EQ(make_fluids(settings, 1, 10)[1].lowest, 10);
  EXPECT_LT(make_fluids(settings, 1, 1e4)[1].lowest, 1);
}

}  // namespace
}  // namespace malleus::inject
