#pragma once

/// What a filling knows of its errors.

#include "engine/error_budget.hpp"
#include "inject/thin_sections.hpp"

namespace malleus::inject {

/// What the sources are told from, at the end of a run.
struct ErrorClues {
  bool has_front = false;
  bool solves_flow = true;
  bool is_linear = true;         ///< all fluids are Newtonian
  bool follows_distance = true;  ///< [flow] update = auto
  Real freezing_elements = 0;    ///< by which keeping the flow misplaced the front, summed
  Real filled_since_flow = 0;    ///< share of the filled volume that came in since the last solve
  Real way_elements = 1;         ///< that the front had before it at the start
  Real cfl = 0;
  Real volume_error = 0;  ///< relative to the cavity
  Real newton_tolerance = 0;
  Real linear_tolerance = 0;
  ThinSections thin;
};

/// All but the error of space. Local.
ErrorBudget error_sources(const ErrorClues& clues);

}  // namespace malleus::inject
