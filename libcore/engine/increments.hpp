#pragma once

/// How increments are planned, tried and cut: alike in a run and in its rehearsal.

#include <functional>

#include "engine/process.hpp"

namespace malleus {

inline constexpr int most_cuts = 12;  ///< of one increment's step

/// Step [s] from a time [s] that is at most `allowed` [s] and meets the end [s] in equal steps; infinite where neither
/// limits it.
Real planned_step(Real allowed, Real time, Real end);

/// Calls the components in their order, each by `advance`. Where one is not done, those before it are rolled back, the
/// latest first, and its outcome is returned with its name before the reason. Collective.
Outcome try_components(Process& process, const std::function<Outcome(Component&)>& advance);

/// The same increment from its start [s] with the step that an outcome tells, or half of it.
Increment shortened(const Increment& increment, Real start, const Outcome& outcome);

}  // namespace malleus
