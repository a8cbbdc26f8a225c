#pragma once

/// From what a run may err or take to the sizes of its mesh and its accuracy level.

#include <optional>
#include <string>

#include "case/run_sections.hpp"
#include "engine/space_estimate.hpp"

namespace malleus {

/// What the case's mesh would give, before any of it was run.
struct Expectation {
  Outlook outlook;
  Real increments = 1;
  int dimension = 3;
  bool steps_follow_sizes = false;  ///< twice as many steps on a mesh of half the sizes
  Real wall_s() const { return outlook.increment_s * increments; }
};

/// What to change.
struct Choice {
  Real size_factor = 1;  ///< of the mesh's sizes, within [0.3, 3]
  Level level = Level::standard;
  std::string reason;  ///< one line for the log
};

/// With the error ~ h^order and the time ~ h^-(dimension + 1 if steps follow): the sizes at which the error is
/// target_error, or coarser ones where target_time does not allow those; the level whose other errors are below it.
Choice choose_for(const AccuracySettings& asked, const Expectation& expected);

}  // namespace malleus
