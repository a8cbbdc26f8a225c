#pragma once

/// Where the error of a forging run's forces comes from.

#include "engine/error_budget.hpp"
#include "forge/scene.hpp"

namespace malleus::forge {

/// What a run measured of itself.
struct RunMeasures {
  Real largest_strain_step = 0;  ///< mean strain of the deformable bodies in one increment, the largest
  Real volume_change = 0;        ///< relative
  Real force_imbalance = 0;      ///< relative to the largest force
  Real max_penetration = 0;      ///< m
  Real travel = 0;               ///< m, of the fastest tool or boundary
  bool gives_step = false;       ///< [time] step is given: it rules the steps
};

/// Sources other than space. The factors are those measured on friction rings and upsettings by independent solvers:
/// time 1.2 (Adams-Bashforth 2) or 0.4 (Runge-Kutta 2) times the square of a step's strain, 0.3 times the strain
/// (Euler); contact 0.1/c; cut-off 0.6 times its square; nonlinear tolerance a half. Local.
ErrorBudget forge_error_budget(const Scene& scene, const RunMeasures& run);

}  // namespace malleus::forge
