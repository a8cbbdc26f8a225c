#include "inject/error_sources.hpp"

#include <algorithm>
#include <cmath>

namespace malleus::inject {
namespace {

/// Of gate pressures, relative, at [front] cfl = 1; goes with its square (channels: 6 to 9 % at 1, 1 to 2 % at 0.5).
constexpr Real substep_error = 0.06;
/// Of what keeping the flow misplaces the front by at the most, where each solve misplaces it another way.
constexpr Real share_of_misplacement = 0.5;
/// Of the pressure drop, relative, of sections with 2 or 3 elements across, and with one, where nothing flows.
constexpr Real thin_error = 0.08;
constexpr Real blocked_error = 1;

}  // namespace

ErrorBudget error_sources(const ErrorClues& clues) {
  ErrorBudget budget;
  if (clues.has_front) {
    budget.add({"front", substep_error * clues.cfl * clues.cfl, "6 % at cfl 1 in channels, of second order",
                "[front] cfl", 0.7, 1.2});
    budget.add({"volume", std::abs(clues.volume_error), "filled less initial less injected", "[front] cfl", 0.5, 1.4});
  }
  if (clues.has_front && clues.solves_flow) {
    // The resistance goes with what is filled: pressures lag by what came in since the flow was last solved.
    const Real misplaced = clues.freezing_elements / std::max(1.0, clues.way_elements);
    const Real lost = std::hypot(share_of_misplacement * misplaced, clues.filled_since_flow);
    budget.add({"frozen flow", lost,
                "change of the front's velocity at each solve, over its way; filled since the last",
                clues.follows_distance ? "[flow] update_distance" : "[flow] update", 0.5, 1.9});
  }
  if (!clues.solves_flow) return budget;
  const Real thin = thin_error * (clues.thin.below_four - clues.thin.below_two) + blocked_error * clues.thin.below_two;
  if (thin > 0) {
    budget.add(
        {"wall resolution", thin, "shares of the cavity below 4 and 2 elements across", "[remesh] size", 0.5, 8});
  }
  if (!clues.is_linear) {
    budget.add(
        {"nonlinear", clues.newton_tolerance, "[solver] newton_tolerance", "[solver] newton_tolerance", 0.5, 1.1});
  }
  budget.add({"linear", clues.linear_tolerance, "[solver] linear_tolerance", "[solver] linear_tolerance", 0.5, 1.05});
  return budget;
}

}  // namespace malleus::inject
