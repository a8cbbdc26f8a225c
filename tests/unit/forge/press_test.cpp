#include "forge/press.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace malleus::forge {
namespace {

/// Drives a press against a material whose resistance is given, with steps of dt, and returns the press at the end.
template <class Force>
Press drive(PressSpec spec, Real end, Real dt, Force force) {
  Press press(std::move(spec));
  Real time = 0;
  for (bool first = true; time < end - 0.5 * dt; first = false) {
    const Displacement displacement = first ? euler_step(dt) : adams_bashforth_step(dt, dt);
    Real resisting = force(press.state().stroke, press.speed(time));
    for (int i = 0; i < 30 && !press.accepts(resisting, time, 1e-8); ++i) {
      resisting = force(press.state().stroke, press.speed(time));
    }
    press.commit(resisting, time, displacement);
    time += dt;
  }
  return press;
}

TEST(Press, OfConstantSpeedGoesStraight) {
  const Press press =
      drive({.kind = PressKind::speed, .speed = [](Real) { return 0.2; }}, 1, 0.1, [](Real, Real) { return 1e9; });
  EXPECT_NEAR(press.state().stroke, 0.2, 1e-14);
}

TEST(Press, SpeedsThatVaryAreIntegratedExactlyUpToCubics) {
  const auto press = drive({.kind = PressKind::speed, .speed = [](Real t) { return 4 * t * t * t; }}, 1, 0.25,
                           [](Real, Real) { return 0.0; });
  EXPECT_NEAR(press.state().stroke, 1, 1e-14);
}

TEST(Press, TableIsFollowedThroughItsKinks) {
  const PressSpec spec = {.kind = PressKind::stroke_table, .table = {{0, 1, 3}, {0.5, 1.5, 1.0}}};
  EXPECT_NEAR(drive(spec, 1, 0.3333333333, [](Real, Real) { return 0.0; }).state().stroke, 1, 1e-9);
  const Press press = drive(spec, 3, 0.3, [](Real, Real) { return 0.0; });
  EXPECT_NEAR(press.state().stroke, 0.5, 1e-12);
  EXPECT_TRUE(press.state().stopped);
  EXPECT_NEAR(Press(spec).speed(0.2), 1, 1e-6);
  EXPECT_NEAR(Press(spec).speed(2), -0.25, 1e-6);
}

/// A die that closes at some stroke: beyond, the force rises linearly by 4e4 times.
TEST(Press, HydraulicHoldsItsLimitWhereADieCloses) {
  const auto force = [](Real stroke, Real speed) {
    const Real beyond = stroke + 0.01 * speed - 0.5;
    return std::pow(std::max(speed, 0.0), 0.3) + std::max(0.0, 4e6 * beyond);
  };
  const PressSpec spec = {.kind = PressKind::hydraulic, .speed = [](Real) { return 1.0; }, .force_limit = 20};
  Press press(spec);
  Real time = 0;
  int solves = 0;
  for (int increment = 0; increment < 70; ++increment, time += 0.01) {
    Real resisting = force(press.state().stroke, press.speed(time));
    for (++solves; !press.accepts(resisting, time, 1e-3); ++solves) {
      ASSERT_LT(solves, 200);
      resisting = force(press.state().stroke, press.speed(time));
    }
    press.commit(resisting, time, euler_step(0.01));
  }
  EXPECT_NEAR(press.state().stroke, 0.5, 1e-5);
  EXPECT_NEAR(press.state().last_force, 20, 0.02);
  EXPECT_TRUE(press.is_stalled(time));
  EXPECT_LT(solves, 70 + 40);
}

TEST(Press, CrankComesDownToItsDeadCentre) {
  const PressSpec spec = {
      .kind = PressKind::crank, .crank_radius = 0.1, .rod_length = 0.5, .rotation_speed = 2, .start_height = 0.2};
  const Press press(spec);
  for (const Real time : {0.1, 0.5, 1.0, 1.5}) {
    const Real angle = 2 * time;  // from the top dead centre, where the rod and the crank are folded
    const Real drop = 0.1 * (1 - std::cos(angle)) - 0.5 + std::sqrt(0.25 - 0.01 * std::pow(std::sin(angle), 2));
    EXPECT_NEAR(press.travel(0, euler_step(time)), drop, 1e-12);
  }
  EXPECT_NEAR(press.travel(0, euler_step(std::numbers::pi / 2)), 0.2, 1e-12);
  EXPECT_NEAR(press.speed(std::numbers::pi / 2), 0, 1e-9);
  PressSpec low = spec;
  low.start_height = 0.03;
  EXPECT_GT(Press(low).speed(0), 0);
}

/// Work of the material against the stroke: a linear dashpot and a constant force have closed forms.
TEST(Press, HammerSpendsItsEnergyOnTheMaterial) {
  const PressSpec spec = {.kind = PressKind::hammer, .energy = 100, .mass = 50};
  const Real first_speed = 2;
  const auto constant = [](Real, Real) { return 400.0; };
  for (const Real dt : {1e-3, 1e-4}) {  // v = 2 - 8 t
    const Press press = drive(spec, 0.1, dt, constant);
    EXPECT_NEAR(press.state().speed, first_speed - 0.8, 1e-12);
    EXPECT_NEAR(press.state().stroke, 0.2 - 4 * 0.01, 0.5 * 8 * dt * dt + 1e-12);  // the Euler start alone is off
  }
  const Press spent = drive(spec, 0.4, 1e-4, constant);
  EXPECT_TRUE(spent.state().stopped);
  EXPECT_EQ(spent.state().speed, 0);
  EXPECT_NEAR(spent.state().stroke, 100.0 / 400, 1e-5);
  EXPECT_EQ(spent.travel(0.4, euler_step(1e-3)), 0);
}

TEST(Press, HammerIsOfSecondOrderAgainstADashpot) {
  const PressSpec spec = {.kind = PressKind::hammer, .energy = 100, .mass = 50};
  const auto dashpot = [](Real, Real speed) { return 300 * speed; };  // v = 2 exp(-6 t)
  const Real exact = 2 * (1 - std::exp(-6 * 0.2)) / 6;
  const Real coarse = std::abs(drive(spec, 0.2, 0.01, dashpot).state().stroke - exact);
  const Real fine = std::abs(drive(spec, 0.2, 0.005, dashpot).state().stroke - exact);
  EXPECT_GT(coarse / fine, 3.5);
  EXPECT_LT(fine / exact, 1e-3);
}

/// Force against the stroke taken at the start of each step, as a user sums the rows of a history.
TEST(Press, ABlowDoesTheWorkOfItsEnergyInTheStepsThatItAsksFor) {
  for (const Real exponent : {0.0, 0.3, 1.0}) {
    Press press({.kind = PressKind::hammer, .energy = 100, .mass = 50});
    Real work = 0;
    Real last_step = 0;
    int steps = 0;
    for (; !press.state().stopped && steps < 200; ++steps) {
      const Real force = 3e4 * std::pow(press.speed(0), exponent);
      const Real dt = press.step_limit(force);
      const Real before = press.state().stroke;
      press.commit(force, 0, last_step > 0 ? adams_bashforth_step(dt, last_step) : euler_step(dt));
      work += force * (press.state().stroke - before);
      last_step = dt;
    }
    EXPECT_TRUE(press.state().stopped);
    EXPECT_NEAR(work / 100, 1, 0.01) << "exponent " << exponent;
    const Real stroke = 50.0 / 3e4 * std::pow(2, 2 - exponent) / (2 - exponent);  // m v dv/ds = - c v^exponent
    EXPECT_NEAR(press.state().stroke / stroke, 1, 3e-3) << "exponent " << exponent;
    EXPECT_LT(steps, 140);
  }
}

TEST(Press, ScrewIsAHammerOfItsEffectiveMass) {
  const auto dashpot = [](Real, Real speed) { return 300 * speed; };
  const Press hammer = drive({.kind = PressKind::hammer, .energy = 100, .mass = 50}, 0.2, 0.01, dashpot);
  const Press screw = drive({.kind = PressKind::screw, .energy = 100, .mass = 50}, 0.2, 0.01, dashpot);
  EXPECT_EQ(hammer.state().stroke, screw.state().stroke);
}

TEST(Press, HydraulicOneKeepsToItsForceLimit) {
  const PressSpec spec = {.kind = PressKind::hydraulic, .speed = [](Real) { return 1.0; }, .force_limit = 100};
  // Resistance 200 w^0.3 (1 + s): full speed is never allowed; w = (0.5 / (1 + s))^(1/0.3).
  const auto material = [](Real stroke, Real speed) { return 200 * std::pow(speed, 0.3) * (1 + stroke); };
  const Press press = drive(spec, 1, 0.01, material);
  EXPECT_NEAR(press.state().last_force, 100, 1e-5);
  // (1+s)^(1/.3) ds = .5^(1/.3) dt  =>  (1+s)^(13/3) = 1 + 13/3 .5^(10/3) t
  const Real exact = std::pow(1 + 13.0 / 3 * std::pow(0.5, 10.0 / 3), 3.0 / 13) - 1;
  EXPECT_NEAR(press.state().stroke / exact, 1, 1e-3);
  const auto soft = [](Real, Real speed) { return 50 * std::pow(speed, 0.3); };
  EXPECT_NEAR(drive(spec, 1, 0.01, soft).state().stroke, 1, 1e-12);
}

TEST(Press, HammerAsksForStepsThatTakeLittleOfItsEnergy) {
  const Press press({.kind = PressKind::hammer, .energy = 100, .mass = 50});
  EXPECT_NEAR(press.step_limit(400) * 400 * 2, 0.03 * 100, 1e-12);
  EXPECT_GT(press.step_limit(0), 1e100);
}

}  // namespace
}  // namespace malleus::forge
