#pragma once

/// One linear system with its best iterate, on which Krylov methods are tried.

#include <functional>
#include <string>

#include "solvers/stokes_linear_solver.hpp"
#include "solvers/stokes_preconditioner.hpp"

namespace malleus {

class KrylovProblem {
 public:
  /// guess: [owned node][dim+1] and borders, or empty for zero. The operator must outlive the problem. Collective.
  KrylovProblem(const BorderedOperator& op, const LinearVector& right_side, const LinearVector& guess);

  /// ||b - K x|| / ||b|| by its definition; 0 where b = 0, not finite where b or K is not.
  Real residual() const { return residual_; }
  Vec solution() const { return x_.get(); }

  /// Our preconditioner, made or kept, when the method (or the user's -pc_type) asks for it. Collective.
  using Provide = std::function<StokesPreconditioner&()>;

  struct Run {
    int iterations = 0;
    std::string reason;  ///< of PETSc, where it did not converge
  };
  /// Runs a method from the best iterate until the true residual is below tolerance ||b||. Keeps the better of the
  /// old and the new iterate. Collective.
  Run run(LinearMethod method, Real tolerance, const LinearSolverOptions& options, const Provide& provide);

 private:
  Real compute_residual();
  Run iterate(KSP ksp, Real tolerance);
  void remove_null_space(Vec vector) const;

  const BorderedOperator& operator_;
  PetscVector b_, x_, work_;
  Real size_ = 0;  ///< ||b||
  Real residual_ = 1;
};

}  // namespace malleus
