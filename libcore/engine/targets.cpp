#include "engine/targets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace malleus {
namespace {

constexpr Real finest = 0.3;
constexpr Real coarsest = 3;

/// The level whose steps and tolerances err less than this, by the tables of the shipped cases.
Level level_for(Real error) {
  if (error >= 0.03) return Level::draft;
  if (error >= 0.007) return Level::standard;
  return error >= 0.001 ? Level::fine : Level::reference;
}

}  // namespace

Choice choose_for(const AccuracySettings& asked, const Expectation& expected) {
  const Outlook& outlook = expected.outlook;
  const Real growth = expected.dimension + (expected.steps_follow_sizes ? 1 : 0);
  Choice choice;
  Real factor = asked.target_error ? finest : 0;
  if (asked.target_error && outlook.error > 0)
    factor = std::pow(*asked.target_error / outlook.error, 1 / outlook.order);
  if (asked.target_time) factor = std::max(factor, std::pow(expected.wall_s() / *asked.target_time, 1 / growth));
  choice.size_factor = std::clamp(factor, finest, coarsest);
  const Real error = outlook.error * std::pow(choice.size_factor, outlook.order);
  const Real time = expected.wall_s() * std::pow(choice.size_factor, -growth);
  choice.level = level_for(asked.target_error ? std::max(*asked.target_error, error) : error);
  std::string asked_for;
  if (asked.target_error) asked_for = fmt::format("target_error {:.2g} %", 100 * *asked.target_error);
  if (asked.target_time) {
    asked_for += fmt::format("{}target_time {:.3g} s", asked_for.empty() ? "" : ", ", *asked.target_time);
  }
  choice.reason = fmt::format(
      "{}: the mesh as given would leave {:.2g} % in {:.3g} s; its sizes times {:.2g} and level {} should leave {:.2g} "
      "% in {:.3g} s",
      asked_for, 100 * outlook.error, expected.wall_s(), choice.size_factor,
      level_names[static_cast<std::size_t>(choice.level)], 100 * error, time);
  if (asked.target_error && error > 1.05 * *asked.target_error) choice.reason += " (the target is out of reach)";
  return choice;
}

}  // namespace malleus
