#include "solvers/krylov_problem.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/floating_point.hpp"
#include "solvers/bordered_preconditioner.hpp"

namespace malleus {
namespace {

constexpr int baseline_restart = 100;
constexpr int long_restart = 150;  // slivers and contrast make outliers, which shorter cycles meet again and again
constexpr int short_restart = 40;
constexpr LocalId long_restart_nodes = 200'000;  // a rank: beyond, 150 vectors would outweigh the matrix

int automatic_restart(const LinearSystem& system) {
  const auto largest = system.comm->max(static_cast<GlobalId>(system.mesh->owned_nodes()));
  return largest <= long_restart_nodes ? long_restart : short_restart;
}
constexpr int baseline_iterations = 20;  ///< times those allowed to our own method

/// A preconditioner of K alone for the methods that need no more: ILU(0) of each rank's rows, or MUMPS.
class KernelPreconditioner {
 public:
  KernelPreconditioner(const LinearSystem& system, LinearMethod method) : matrix_(system) {
    petsc_call(PCCreate(system.comm->raw(), pc_.out()));
    petsc_call(PCSetOptionsPrefix(pc_.get(), "kernel_"));
    petsc_call(PCSetOperators(pc_.get(), matrix_.get(), matrix_.get()));
    if (method == LinearMethod::direct) {
      set_direct();
    } else {
      petsc_call(PCSetType(pc_.get(), PCBJACOBI));
    }
    petsc_call(PCSetFromOptions(pc_.get()));
    const TrapsOff traps_off;
    petsc_call(PCSetUp(pc_.get()));
  }
  PC get() const { return pc_.get(); }

 private:
  void set_direct() {
    petsc_call(PCSetType(pc_.get(), PCLU));
    petsc_call(PCFactorSetMatSolverType(pc_.get(), MATSOLVERMUMPS));
    petsc_call(PCFactorSetUpMatSolverType(pc_.get()));
    Mat factor = nullptr;
    petsc_call(PCFactorGetMatrix(pc_.get(), &factor));
    constexpr PetscInt null_pivots = 24;  // detection of the constant pressure's pivot
    petsc_call(MatMumpsSetIcntl(factor, null_pivots, 1));
  }

  AssembledMatrix matrix_;
  PetscPreconditioner pc_;
};

/// For methods that do not know their true residual: looks at it every few iterations.
struct TrueResidualTest {
  static constexpr PetscInt interval = 8;
  Real target = 0;  ///< ||b - K x||

  static PetscErrorCode judge(KSP ksp, PetscInt iteration, PetscReal norm, KSPConvergedReason* reason, void* context) {
    *reason = std::isfinite(norm) ? KSP_CONVERGED_ITERATING : KSP_DIVERGED_NANORINF;
    if (*reason != KSP_CONVERGED_ITERATING || iteration == 0 || iteration % interval != 0) return 0;
    Vec residual = nullptr;
    PetscReal size = 0;
    PetscCall(KSPBuildResidual(ksp, nullptr, nullptr, &residual));
    PetscCall(VecNorm(residual, NORM_2, &size));
    PetscCall(VecDestroy(&residual));
    if (size <= static_cast<TrueResidualTest*>(context)->target) *reason = KSP_CONVERGED_RTOL;
    return 0;
  }
};

void choose_type(KSP ksp, LinearMethod method, Real tolerance, const LinearSolverOptions& options) {
  int restart = options.restart;
  int iterations = options.max_iterations;
  switch (method) {
    case LinearMethod::block_triangular:
    case LinearMethod::gamg:
    case LinearMethod::direct:
      petsc_call(KSPSetType(ksp, KSPFGMRES));
      break;
    case LinearMethod::gmres_ilu:
      petsc_call(KSPSetType(ksp, KSPGMRES));
      petsc_call(KSPSetPCSide(ksp, PC_RIGHT));  // the left one would stop on the preconditioned residual
      restart = std::max(restart, baseline_restart);
      iterations *= baseline_iterations;
      break;
    case LinearMethod::conjugate_residual:
      petsc_call(KSPSetType(ksp, KSPMINRES));
      iterations *= baseline_iterations;
      break;
  }
  if (method != LinearMethod::conjugate_residual) {
    petsc_call(KSPGMRESSetRestart(ksp, restart));
    // With contrast the basis loses its orthogonality, and the residual of the recurrence falls below the true one.
    petsc_call(KSPGMRESSetCGSRefinementType(ksp, KSP_GMRES_CGS_REFINE_IFNEEDED));
  }
  constexpr Real margin = 0.95;  // between the recurrence's residual and the true one
  petsc_call(KSPSetTolerances(ksp, margin * tolerance, 0.0, PETSC_DEFAULT, iterations));
}

}  // namespace

KrylovProblem::KrylovProblem(const BorderedOperator& op, const LinearVector& right_side, const LinearVector& guess)
    : operator_(op), b_(op.make_vector()), x_(op.make_vector()), work_(op.make_vector()) {
  op.fill(right_side, b_.get());
  petsc_call(VecNorm(b_.get(), NORM_2, &size_));
  if (!std::isfinite(size_)) {
    residual_ = size_;
    return;
  }
  remove_null_space(b_.get());
  if (guess.nodes.size() == op.node_unknowns() && guess.borders.size() == op.system().borders.size()) {
    op.fill(guess, x_.get());
  }
  residual_ = compute_residual();
  const bool is_useful = residual_ < 1;
  if (!is_useful) {
    petsc_call(VecZeroEntries(x_.get()));
    residual_ = compute_residual();
  }
}

void KrylovProblem::remove_null_space(Vec vector) const {
  if (operator_.null_space() != nullptr) petsc_call(MatNullSpaceRemove(operator_.null_space(), vector));
}

Real KrylovProblem::compute_residual() {
  if (size_ <= 0) return 0;
  petsc_call(MatMult(operator_.matrix(), x_.get(), work_.get()));
  petsc_call(VecAYPX(work_.get(), -1.0, b_.get()));
  PetscReal rest = 0;
  petsc_call(VecNorm(work_.get(), NORM_2, &rest));
  return rest / size_;
}

KrylovProblem::Run KrylovProblem::run(LinearMethod method, Real tolerance, const LinearSolverOptions& options,
                                      const Provide& provide) {
  PetscSolver ksp;
  petsc_call(KSPCreate(operator_.system().comm->raw(), ksp.out()));
  petsc_call(MatSetNullSpace(operator_.matrix(), operator_.null_space()));
  petsc_call(KSPSetOperators(ksp.get(), operator_.matrix(), operator_.matrix()));
  LinearSolverOptions chosen = options;
  if (chosen.restart <= 0) chosen.restart = automatic_restart(operator_.system());
  choose_type(ksp.get(), method, tolerance, chosen);
  PC pc = nullptr;
  petsc_call(KSPGetPC(ksp.get(), &pc));
  std::optional<KernelPreconditioner> kernel;
  std::optional<BorderedPreconditioner> bordered;
  if (method == LinearMethod::direct || method == LinearMethod::gmres_ilu) {
    kernel.emplace(operator_.system(), method);
    bordered.emplace(operator_, kernel->get(), false);
    use_bordered_preconditioner(pc, *bordered);
  } else {
    petsc_call(PCSetType(pc, stokes_preconditioner_type));
  }
  TrueResidualTest test{tolerance * size_};
  if (method == LinearMethod::conjugate_residual) {
    petsc_call(KSPSetConvergenceTest(ksp.get(), TrueResidualTest::judge, &test, nullptr));
  }
  petsc_call(KSPSetFromOptions(ksp.get()));
  PetscBool is_ours = PETSC_FALSE;
  petsc_call(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), stokes_preconditioner_type, &is_ours));
  if (is_ours == PETSC_TRUE) use_stokes_preconditioner(pc, provide());
  return iterate(ksp.get(), tolerance);
}

KrylovProblem::Run KrylovProblem::iterate(KSP ksp, Real tolerance) {
  constexpr int rounds = 3;  // more than one only where the recurrence has drifted from the true residual
  Run result;
  PetscVector before;
  petsc_call(VecDuplicate(x_.get(), before.out()));
  for (int round = 0; round < rounds && residual_ > tolerance; ++round) {
    petsc_call(VecCopy(x_.get(), before.get()));
    petsc_call(KSPSetInitialGuessNonzero(ksp, residual_ < 1 ? PETSC_TRUE : PETSC_FALSE));
    petsc_call(KSPSolve(ksp, b_.get(), x_.get()));
    PetscInt iterations = 0;
    petsc_call(KSPGetIterationNumber(ksp, &iterations));
    result.iterations += iterations;
    KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
    petsc_call(KSPGetConvergedReason(ksp, &reason));
    remove_null_space(x_.get());
    const Real reached = compute_residual();
    const bool is_better = reached < residual_;  // false for NaN
    if (is_better) {
      residual_ = reached;
    } else {
      petsc_call(VecCopy(before.get(), x_.get()));
    }
    if (reason < 0 || !is_better) {
      const char* text = nullptr;
      petsc_call(KSPGetConvergedReasonString(ksp, &text));
      result.reason = reason < 0 ? text : "the residual no longer falls";
      break;
    }
  }
  return result;
}

}  // namespace malleus
