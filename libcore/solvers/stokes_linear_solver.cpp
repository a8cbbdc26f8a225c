#include "solvers/stokes_linear_solver.hpp"

#include "solvers/bordered_preconditioner.hpp"

namespace malleus {
namespace {

using PetscSolver = PetscOwner<KSP, KSPDestroy>;
using PetscPreconditioner = PetscOwner<PC, PCDestroy>;

}  // namespace

class StokesLinearSolver::Implementation {
 public:
  explicit Implementation(LinearSolverOptions options) : options_(options) {}

  LinearOutcome solve(const LinearSystem& system, const LinearVector& right_side, Real tolerance,
                      LinearVector& solution);
  void reset() {}

 private:
  LinearSolverOptions options_;
};

LinearOutcome StokesLinearSolver::Implementation::solve(const LinearSystem& system, const LinearVector& right_side,
                                                        Real tolerance, LinearVector& solution) {
  LinearOutcome outcome;
  const BorderedOperator op(system);
  PetscSolver ksp;
  petsc_call(KSPCreate(system.comm->raw(), ksp.out()));
  petsc_call(KSPSetOperators(ksp.get(), op.matrix(), op.matrix()));
  petsc_call(MatSetNullSpace(op.matrix(), op.null_space()));
  petsc_call(KSPSetType(ksp.get(), KSPFGMRES));
  petsc_call(KSPGMRESSetRestart(ksp.get(), 150));
  petsc_call(KSPSetTolerances(ksp.get(), tolerance, 0.0, PETSC_DEFAULT, 2000));
  PetscPreconditioner kernel;
  petsc_call(PCCreate(system.comm->raw(), kernel.out()));
  if (system.mesh->total_nodes() <= options_.direct_limit) {
    petsc_call(PCSetOperators(kernel.get(), system.matrix, system.matrix));
    petsc_call(PCSetType(kernel.get(), PCLU));
    petsc_call(PCFactorSetMatSolverType(kernel.get(), MATSOLVERMUMPS));
    petsc_call(PCFactorSetUpMatSolverType(kernel.get()));
    Mat factor = nullptr;
    petsc_call(PCFactorGetMatrix(kernel.get(), &factor));
    petsc_call(MatMumpsSetIcntl(factor, 24, 1));
  } else {
    petsc_call(PCSetOperators(kernel.get(), system.matrix, system.matrix));
    petsc_call(PCSetType(kernel.get(), PCBJACOBI));
  }
  petsc_call(PCSetUp(kernel.get()));
  BorderedPreconditioner preconditioner(op, kernel.get(), false);
  PC pc = nullptr;
  petsc_call(KSPGetPC(ksp.get(), &pc));
  use_bordered_preconditioner(pc, preconditioner);
  petsc_call(KSPSetFromOptions(ksp.get()));
  const PetscVector b = op.make_vector();
  const PetscVector x = op.make_vector();
  op.fill(right_side, b.get());
  PetscReal size = 0;
  petsc_call(VecNorm(b.get(), NORM_2, &size));
  if (op.null_space() != nullptr) petsc_call(MatNullSpaceRemove(op.null_space(), b.get()));
  petsc_call(KSPSolve(ksp.get(), b.get(), x.get()));
  PetscInt iterations = 0;
  petsc_call(KSPGetIterationNumber(ksp.get(), &iterations));
  outcome.iterations = iterations;
  if (op.null_space() != nullptr) petsc_call(MatNullSpaceRemove(op.null_space(), x.get()));
  const PetscVector r = op.make_vector();
  petsc_call(MatMult(op.matrix(), x.get(), r.get()));
  petsc_call(VecAYPX(r.get(), -1.0, b.get()));
  PetscReal rest = 0;
  petsc_call(VecNorm(r.get(), NORM_2, &rest));
  outcome.residual = size > 0 ? rest / size : 0;
  outcome.converged = outcome.residual <= 1.01 * tolerance;
  if (!outcome.converged) outcome.reason = "the linear solver did not reach its tolerance";
  outcome.setup_built = true;
  op.extract(x.get(), solution);
  return outcome;
}

StokesLinearSolver::StokesLinearSolver(LinearSolverOptions options)
    : implementation_(std::make_unique<Implementation>(options)) {}
StokesLinearSolver::StokesLinearSolver(StokesLinearSolver&&) noexcept = default;
StokesLinearSolver& StokesLinearSolver::operator=(StokesLinearSolver&&) noexcept = default;
StokesLinearSolver::~StokesLinearSolver() = default;

LinearOutcome StokesLinearSolver::solve(const LinearSystem& system, const LinearVector& right_side, Real tolerance,
                                        LinearVector& solution) {
  return implementation_->solve(system, right_side, tolerance, solution);
}

void StokesLinearSolver::reset() {
  implementation_->reset();
}

}  // namespace malleus
