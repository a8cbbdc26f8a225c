#pragma once

/// Newton's method for the nonlinear Stokes equations.

#include <span>
#include <string>

#include "fem/stokes_operator.hpp"
#include "solvers/stokes_linear_solver.hpp"

namespace malleus {

struct NewtonOptions {
  Real tolerance = 1e-4;         ///< relative nonlinear residual, contact terms included
  Real linear_tolerance = 1e-6;  ///< of linear problems, and of the last linear solve of the loop
  Real largest_forcing = 5e-2;   ///< loosest tolerance of the linear solves on the way
  int max_iterations = 40;       ///< Picard steps counted
  bool picard_alone = false;     ///< no Newton steps: slow (contracts by 1 - m) and sure
  int max_cuts = 8;              ///< of one step by the line search
  int set_iterations = 15;       ///< in which each step holds the branches of terms (contacts) as they are at its start
  /// Shear rate [1/s] at which viscosities are taken for the first step from a cold start; 0 = take the start state's.
  Real start_shear_rate = 0;
  /// [element] the same where an earlier solution on another mesh tells them element by element; empty: it does not.
  std::span<const Real> start_shear_rates = {};
};

/// One iteration, for the log.
struct NewtonIteration {
  bool newton = false;  ///< false: a Picard step
  Real residual = 0;    ///< relative, at its end
  Real step = 1;        ///< share of the full step taken
  int linear_iterations = 0;
  Real linear_residual = 0;  ///< relative, reached
};

/// How a solve ended; the same on all ranks. Where it did not converge the state is the best found and must not be
/// taken for a solution.
struct NewtonOutcome {
  bool converged = false;
  Real residual = 0;  ///< relative, at the end
  int linear_iterations = 0;
  int linear_solves = 0;
  Real assembly_seconds = 0;
  Real setup_seconds = 0;  ///< of preconditioners
  Real solve_seconds = 0;
  std::vector<NewtonIteration> history;
  std::string reason;  ///< why it did not converge; with the place of the worst node
  WorstNode worst;     ///< where it did not converge

  int iterations() const noexcept { return static_cast<int>(history.size()); }
};

/// Solves residual(state) = 0.
///
/// A linear problem is solved once, to linear_tolerance relative to the right side that the prescribed velocities and
/// loads make at rest. Otherwise: the first step from a cold start takes one viscosity at start_shear_rate; then Picard
/// steps, three and only where the laws' sensitivity is below 0.3 (Picard contracts by 1 - m), then Newton. A Newton
/// step is cut where the convex potential that the flow minimises (dissipation, contact, friction, at the step's new
/// pressures) has risen again along it: a search on the norm of the residual stalls at m < 0.1. Linear solves are as
/// exact as the progress warrants (Eisenstat and Walker 1996, choice 2), the last one to linear_tolerance of the whole.
/// The tangent is consistent (see Tangent) near the solution, unless the linear solver needs symmetry. Measured on a
/// block of 512 triangles between sticking platens, from a cold start to 1e-6, cut-off 1e-2 V/H: 5, 7, 10, 12, 16
/// iterations at m = 0.5, 0.3, 0.1, 0.05, 0.02.
///
/// With inertia Picard steps (the carrying velocity kept) lead up to a relative residual of 0.2, Newton steps from
/// there, each halved until the norm of the residual falls.
///
/// Terms with branches (contacts) are solved by an active set: each step is made with the branches of its start, from a
/// warm start with those that the terms carry from the last increment; convergence is judged without that. Three bodies
/// in contact (cases/press, 695 nodes, to 1e-6): 4 to 5 iterations an increment, 8 to 13 with the plus function alone.
class NewtonSolver {
 public:
  explicit NewtonSolver(NewtonOptions options) : options_(options) {}

  /// state: the first guess on entry, the solution on return. op: prepared; constraints are imposed on the state.
  /// Collective.
  NewtonOutcome solve(StokesOperator& op, StokesLinearSolver& linear, StokesState& state) const;

 private:
  NewtonOptions options_;
};

}  // namespace malleus
