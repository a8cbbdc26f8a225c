/// How the speeds of presses and the forces of the flow come to agree.

#include <fmt/format.h>

#include <limits>

#include "base/log.hpp"
#include "forge/contact_flow.hpp"

namespace malleus::forge {
namespace {

constexpr int most_plans = 25;  ///< of a hydraulic press
/// Solves under a press at its force limit are so much sharper: the pressure of a full die hangs on the last digits of
/// the volume that flows.
constexpr Real sharper = 1e-2;
/// Of the power of tools, that the penalties of contacts may take: some times the 2 / c that they take where bodies
/// flow, within bounds.
constexpr Real tolerated_loss = 10;  // over c
constexpr Real least_tolerated_loss = 0.03;
constexpr Real largest_tolerated_loss = 0.5;
/// Times the flow stress, that tools press on the mean where nothing flows.
constexpr Real enormous = 50;
/// A step of a blow may be so many times as long as the force of the increment allows.
constexpr Real tolerated_excess = 1.2;

}  // namespace

/// Tools that go on where a die is full press the bodies through the contacts: their work goes into the penalties, at
/// pressures that no flow asks for, and forces mean nothing any more. A press at its force limit has stopped before.
Outcome ContactFlow::check_room(Real time) const {
  if (any_press([&](const Press& press) { return press.is_limited(time); })) return Outcome::done();
  Real stress = std::numeric_limits<Real>::max();  // of the softest body at the reference rate
  for (std::size_t region = 0; region < scene_.bodies.size(); ++region) {
    if (!scene_.bodies[region].is_deformable()) continue;
    stress = std::min(stress, 3 * scene_.body_scales[region].viscosity * scene_.scale.rate());
  }
  Real pressure = 0;
  for (std::size_t t = 0; t < scene_.tools.size(); ++t) {
    if (report_.contact_areas[t] > 0)
      pressure = std::max(pressure, report_.tool_forces[t].norm() / report_.contact_areas[t]);
  }
  const Real given = std::abs(report_.power.tools + report_.power.imposed);
  const Real tolerated =
      std::clamp(tolerated_loss / scene_.penalty.penalty, least_tolerated_loss, largest_tolerated_loss);
  if (pressure < enormous * stress || !(report_.lost_power > tolerated * given)) return Outcome::done();
  return Outcome::fail(fmt::format(
      "the die is full: the tools press with {:.0f} times the flow stress, and {:.0f} % of their power goes "
      "into the penalties of the contacts; end at this stroke, or give the tool press = hydraulic with a "
      "force_limit",
      pressure / stress, 100 * report_.lost_power / given));
}

/// A blow must not spend energy that it does not have: the force of this increment may exceed the last one's by far.
Outcome ContactFlow::check_blows(Real dt) const {
  for (std::size_t t = 0; t < scene_.tools.size(); ++t) {
    const Tool& tool = scene_.tools[t];
    const Real limit = tool.press().step_limit(tool.resistance(report_.tool_forces[t]));
    if (dt > tolerated_excess * limit) {
      return Outcome::retry(fmt::format("the blow of {} would spend too much of its energy", tool.name()), limit);
    }
  }
  return Outcome::done();
}

/// Presses with a force limit change their speed until force and speed agree. Where a die closes the speed changes at
/// once: the history of Adams-Bashforth means nothing then, and Euler's step takes its place.
Outcome ContactFlow::solve_under_presses(Stage& stage) {
  const Real tolerance = std::max(10 * scene_.solver.newton_tolerance, 1e-6);
  tolerance_ = scene_.solver.newton_tolerance;
  for (int plan = 0; plan < most_plans; ++plan) {
    if (any_press([&](const Press& press) { return press.is_stalled(stage.start_time); }))
      stage.displacement = euler_step(stage.displacement.step);
    if (any_press([&](const Press& press) { return press.is_limited(stage.start_time); }))
      tolerance_ = sharper * scene_.solver.newton_tolerance;
    for (Tool& tool : scene_.tools) tool.plan(stage.start_time, stage.displacement);
    const Outcome outcome = solve(stage);
    if (outcome.kind != Outcome::Kind::done && !stop_presses(stage.start_time)) return outcome;
    if (outcome.kind == Outcome::Kind::done && accept_forces(stage, tolerance)) return outcome;
    start_again(stage.start_time);
  }
  return Outcome::retry("a press found no speed at which its force limit holds");
}

/// The first guess for presses that changed their speeds: the state before the increment, as much slower as they are. A
/// state that closed a die at the old speed has pressures in which the forces of the new one would be lost.
void ContactFlow::start_again(Real time) {
  Real share = 0;
  for (std::size_t t = 0; t < scene_.tools.size(); ++t) {
    const Press& press = scene_.tools[t].press();
    const Real before = saved_.presses[t].speed;
    if (scene_.tools[t].moves()) share = std::max(share, before > 0 ? press.speed(time) / before : 1);
  }
  std::size_t i = 0;
  for (Field* field : scene_.fields.all()) {
    std::copy(saved_.fields[i].begin(), saved_.fields[i].end(), field->values().begin());
    ++i;
  }
  for (Real& value : scene_.fields[field_name::velocity].values()) value *= std::min(share, 1.0);
  memory_ = saved_.memory;
}

bool ContactFlow::any_press(const std::function<bool(const Press&)>& is) const {
  return std::any_of(scene_.tools.begin(), scene_.tools.end(), [&](const Tool& tool) { return is(tool.press()); });
}

/// Whether the forces of the solve agree with the presses; else their speeds have changed.
bool ContactFlow::accept_forces(Stage& stage, Real tolerance) {
  bool accepted = true;
  bool overloaded = false;
  for (std::size_t t = 0; t < scene_.tools.size(); ++t) {
    Press& press = scene_.tools[t].press();
    const Real resistance = scene_.tools[t].resistance(report_.tool_forces[t]);
    if (press.spec().kind == PressKind::hydraulic) {
      log::debug("  press of {}: {:.6g} N at {:.6g} m/s", scene_.tools[t].name(), resistance,
                 press.speed(stage.start_time));
    }
    accepted = press.accepts(resistance, stage.start_time, tolerance) && accepted;
    overloaded = overloaded || press.is_overloaded(resistance);
  }
  if (accepted || !overloaded || stage.displacement.before == 0) return accepted;
  stage.displacement = euler_step(stage.displacement.step);
  for (Tool& tool : scene_.tools) tool.press().forget_trials();
  return false;
}

/// Where a solve failed under presses that crawl or went back: those hold still. Whether there were any.
bool ContactFlow::stop_presses(Real time) {
  bool stopped = false;
  for (Tool& tool : scene_.tools) {
    if (!tool.press().is_stalled(time) || tool.press().speed(time) == 0) continue;
    tool.press().hold_still();
    stopped = true;
  }
  return stopped;
}

}  // namespace malleus::forge
