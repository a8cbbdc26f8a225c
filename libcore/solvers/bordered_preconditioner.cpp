#include "solvers/bordered_preconditioner.hpp"

#include <algorithm>
#include <cmath>

#include "parallel/petsc_shell.hpp"

namespace malleus {

Eigen::MatrixXd symmetric_pseudo_inverse(const Eigen::MatrixXd& matrix, bool absolute) {
  if (matrix.size() == 0) return matrix;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(0.5 * (matrix + matrix.transpose()));
  Eigen::VectorXd values = solver.eigenvalues();
  const Real least = 1e-12 * values.cwiseAbs().maxCoeff();
  for (Real& value : values) {
    if (absolute) value = std::abs(value);
    value = std::abs(value) > least ? 1 / value : 0;
  }
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

BorderedPreconditioner::BorderedPreconditioner(const BorderedOperator& op, PC kernel, bool positive)
    : operator_(op), kernel_(kernel), positive_(positive) {
  petsc_call(MatCreateVecs(op.system().matrix, in_.out(), out_.out()));
  const int borders = op.borders();
  Eigen::MatrixXd schur(borders, borders);
  for (int j = 0; j < borders; ++j) {
    std::vector<Real> unit(static_cast<std::size_t>(borders), 0.0);
    unit[static_cast<std::size_t>(j)] = 1;
    std::vector<Real> column(op.node_unknowns(), 0.0);
    op.add_borders(unit, 1.0, column.data());
    columns_.emplace_back(op.node_unknowns());
    apply_kernel(column.data(), columns_.back().data());
    const std::vector<Real> products = op.border_products(columns_.back().data());
    for (int i = 0; i < borders; ++i) schur(i, j) = -products[static_cast<std::size_t>(i)];
    schur(j, j) += op.system().borders[static_cast<std::size_t>(j)].diagonal;
  }
  inverse_ = symmetric_pseudo_inverse(schur, positive);
}

void BorderedPreconditioner::apply_kernel(const Real* residual, Real* correction) {
  petsc_call(VecPlaceArray(in_.get(), residual));
  petsc_call(VecPlaceArray(out_.get(), correction));
  petsc_call(PCApply(kernel_, in_.get(), out_.get()));
  petsc_call(VecResetArray(in_.get()));
  petsc_call(VecResetArray(out_.get()));
}

void BorderedPreconditioner::apply(const Real* residual, Real* correction) {
  apply_kernel(residual, correction);
  std::vector<Real> rest = operator_.border_values(residual);
  if (!positive_) {
    const std::vector<Real> products = operator_.border_products(correction);
    for (std::size_t j = 0; j < rest.size(); ++j) rest[j] -= products[j];
  }
  const Eigen::VectorXd q = inverse_ * Eigen::Map<const Eigen::VectorXd>(rest.data(), operator_.borders());
  for (std::size_t j = 0; j < columns_.size() && !positive_; ++j) {
    const Real factor = q[static_cast<Eigen::Index>(j)];
    for (std::size_t i = 0; i < columns_[j].size(); ++i) correction[i] -= factor * columns_[j][i];
  }
  if (operator_.system().comm->is_root()) std::copy(q.begin(), q.end(), correction + operator_.node_unknowns());
}

void use_bordered_preconditioner(PC pc, BorderedPreconditioner& preconditioner) {
  petsc_call(PCSetType(pc, PCSHELL));
  petsc_call(PCShellSetContext(pc, &preconditioner));
  petsc_call(PCShellSetApply(pc, apply_shell<BorderedPreconditioner>));
  petsc_call(PCShellSetName(pc, "border elimination"));
}

}  // namespace malleus
