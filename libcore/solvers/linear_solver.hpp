#pragma once

/// What the nonlinear solvers ask of a linear solver.

#include <memory>
#include <string>
#include <string_view>

#include "fem/linear_system.hpp"

namespace malleus {

struct LinearControl {
  Real relative_tolerance = 1e-6;  ///< of the true residual: ||b - A x|| / ||b||, borders included
  int max_iterations = 500;
};

/// How a linear solve ended; decided on reduced values, so the same on all ranks.
struct LinearOutcome {
  bool converged = false;
  int iterations = 0;
  Real relative_residual = 0;  ///< ||b - A x|| / ||b||, recomputed from the matrix, not the recurrence's
  Real setup_seconds = 0;      ///< preconditioner
  Real solve_seconds = 0;
  std::string reason;  ///< why not, where it did not converge
};

/// Solves linear systems of the form of LinearSystem. It keeps hierarchies, factors and work vectors between calls and
/// renews what system.pattern_version and system.value_version say is out of date.
class LinearSolver {
 public:
  LinearSolver() = default;
  LinearSolver(const LinearSolver&) = delete;
  LinearSolver& operator=(const LinearSolver&) = delete;
  virtual ~LinearSolver() = default;

  virtual std::string_view name() const = 0;
  /// Solves from a zero start. `solution` is resized. Where it does not converge the solution is the best found.
  /// With pressure_is_free, the solution's pressures (borders included) have any constant. Collective.
  virtual LinearOutcome solve(const LinearSystem& system, const LinearVector& right_side, const LinearControl& control,
                              LinearVector& solution) = 0;
};

}  // namespace malleus
