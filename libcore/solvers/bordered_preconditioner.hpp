#pragma once

/// A PETSc preconditioner of K made one of the bordered system.

#include <Eigen/Dense>

#include "solvers/bordered_operator.hpp"

namespace malleus {

/// Pseudo-inverse of a small symmetric matrix: eigenvalues below 1e-12 of the largest are left out. With `absolute`,
/// of its absolute value. Local.
Eigen::MatrixXd symmetric_pseudo_inverse(const Eigen::MatrixXd& matrix, bool absolute = false);

/// Block elimination with a preconditioner M of K: q = E^+ (r_q - g^T M^-1 r), z = M^-1 r - M^-1 g q, with
/// E = d - g^T M^-1 g. Exact where M is. With `positive` the block diagonal (M, |E|), which is positive where M is.
class BorderedPreconditioner {
 public:
  /// kernel: set up on K, of a type that needs nothing else; owned by the caller. Collective.
  BorderedPreconditioner(const BorderedOperator& op, PC kernel, bool positive);

  void apply(const Real* residual, Real* correction);  ///< collective

 private:
  void apply_kernel(const Real* residual, Real* correction);

  const BorderedOperator& operator_;
  PC kernel_;
  bool positive_;
  PetscVector in_;
  PetscVector out_;
  std::vector<std::vector<Real>> columns_;  ///< M^-1 g_j: [border][owned node][dim+1]
  Eigen::MatrixXd inverse_;                 ///< E^+
};

/// Makes `pc` (of the bordered system) apply `preconditioner`, which must outlive it.
void use_bordered_preconditioner(PC pc, BorderedPreconditioner& preconditioner);

}  // namespace malleus
