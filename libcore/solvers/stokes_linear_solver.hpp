#pragma once

/// Solves the linear systems of Stokes steps. Never returns a failed solve as a good one.

#include <memory>
#include <string>

#include "fem/linear_system.hpp"
#include "solvers/preconditioner_settings.hpp"

namespace malleus {

/// What solves a linear system. `block_triangular` is the default: flexible GMRES, preconditioned by our multigrid
/// for A and a mass matrix for the Schur complement. The others are baselines and fallbacks.
enum class LinearMethod {
  block_triangular,  ///< FGMRES, own smoothed-aggregation multigrid for the velocities
  gamg,              ///< the same with PETSc's GAMG (rigid-body modes, threshold 0.01) for the velocities
  gmres_ilu,         ///< GMRES with ILU(0) of each rank's rows
  /// Conjugate residuals in the form that is stable for indefinite systems (MINRES: Paige, Saunders 1975), with the
  /// preconditioner's block diagonal. Reaches residuals down to 1e-7: single precision in the pressure's part.
  conjugate_residual,
  direct  ///< MUMPS: an oracle for small systems
};

struct LinearSolverOptions {
  LinearMethod method = LinearMethod::block_triangular;
  PreconditionerSettings preconditioner = {};
  int restart = 0;                ///< Krylov vectors between restarts; 0 = 150 up to 200,000 nodes a rank, else 40
  int max_iterations = 300;       ///< of each step of the fallback chain; 20 times as many for the baselines
  bool reuse_setup = true;        ///< keep a hierarchy for later systems until the iterations grow
  bool matrix_free = false;       ///< for memory: keep systems by their products alone, where they can be
  bool fall_back = true;          ///< try stronger settings where a solve fails
  LocalId direct_limit = 50'000;  ///< nodes over all ranks up to which the chain ends in MUMPS
};

/// How a solve went; the same on all ranks.
struct LinearOutcome {
  bool converged = false;    ///< true residual ||b - K x|| / ||b|| <= the tolerance asked for
  int iterations = 0;        ///< of all steps of the chain
  Real residual = 1;         ///< ||b - K x|| / ||b||, computed from its definition after the solve
  bool setup_built = false;  ///< false: an earlier hierarchy was used
  int fallbacks = 0;         ///< steps of the chain beyond the first
  std::string reason;        ///< why it failed; empty where converged
  Real setup_seconds = 0;
  Real solve_seconds = 0;
};

/// Keeps the hierarchy between the systems of a run, and what the fallback chain learned. Options of the PETSc
/// database act on it without a prefix (-ksp_view, -ksp_monitor_true_residual, -ksp_type, -pc_type, ...). Our
/// preconditioner is registered with PETSc as "malleus_stokes"; its own options are
///   -malleus_method block_triangular | gamg | gmres_ilu | conjugate_residual | direct
///   -malleus_modes automatic | translations | rigid
///   -malleus_precision automatic | single | double
///   -malleus_matrix assembled | free
///   -malleus_threshold <strong couplings, 0.25>  -malleus_chebyshev_steps <3>  -malleus_restart <150 or 40>
/// The choices made are said in the log's details, fallbacks as warnings.
class StokesLinearSolver {
 public:
  explicit StokesLinearSolver(LinearSolverOptions options = {});
  StokesLinearSolver(StokesLinearSolver&&) noexcept;
  StokesLinearSolver& operator=(StokesLinearSolver&&) noexcept;
  ~StokesLinearSolver();

  /// Solves K x = b to ||b - K x|| <= tolerance ||b||. solution: the first guess on entry (empty = zero), the
  /// best iterate on return; not to be used unless the outcome is converged. Where the pressure is free, its nodal
  /// mean over the modelled nodes and the border unknowns is zero. Collective.
  LinearOutcome solve(const LinearSystem& system, const LinearVector& right_side, Real tolerance,
                      LinearVector& solution);

  /// Whether the method chosen asks for symmetric systems.
  bool needs_symmetry() const;

  /// Whether systems shall be kept by their products alone (see StokesOperator::use_matrix_free).
  bool is_matrix_free() const;

  /// Forgets the hierarchy, as after a remesh. The next solve builds a new one.
  void reset();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace malleus
