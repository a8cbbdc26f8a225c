#pragma once

/// Where the error of a forging run's forces comes from.

#include "engine/error_budget.hpp"
#include "forge/increment_errors.hpp"

namespace malleus::forge {

/// What a run measured of itself.
struct RunMeasures {
  Real largest_strain_step = 0;  ///< mean strain of the deformable bodies in one increment, the largest
  Real volume_change = 0;        ///< relative
  Real raw_volume_drift = 0;     ///< relative: what the motion alone would have lost
  ForceErrors forces;            ///< root mean squares over the increments
  Real max_penetration = 0;      ///< m
  Real travel = 0;               ///< m, of the fastest tool or boundary
  bool gives_step = false;       ///< [time] step is given: it rules the steps
};

/// Sources other than space. Time: the flow that gives the lost volume back, and half of that loss over the run, which
/// tells how the scheme's errors add up in the shape (Euler: 0.3 times a step's strain, as measured on friction rings
/// and upsettings by independent solvers). Nonlinear: half of the residual reached. Local.
ErrorBudget forge_error_budget(const Scene& scene, const RunMeasures& run);

}  // namespace malleus::forge
