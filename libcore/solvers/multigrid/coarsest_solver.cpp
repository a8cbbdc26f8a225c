#include "solvers/multigrid/coarsest_solver.hpp"

#include <algorithm>
#include <cmath>

#include "base/index.hpp"

namespace malleus {
namespace {

constexpr GlobalId direct_unknowns = 3000;
constexpr int sweeps = 16;

Eigen::MatrixXd to_dense(const MultigridLevel& level) {
  const int block = level.values.rows;
  const Eigen::Index size = static_cast<Eigen::Index>(level.graph.rows()) * block;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
  for (LocalId row = 0; row < level.graph.rows(); ++row) {
    for (LocalId k = level.graph.offsets[index(row)]; k < level.graph.offsets[index(row) + 1]; ++k) {
      const Eigen::Index column = static_cast<Eigen::Index>(level.graph.columns[index(k)]) * block;
      dense.block(static_cast<Eigen::Index>(row) * block, column, block, block) =
          Eigen::Map<const Eigen::MatrixXd>(level.values.at(k), block, block);
    }
  }
  return dense;
}

/// Of a matrix with a unit diagonal that convection makes unsymmetric; directions of no stiffness are left out.
Eigen::MatrixXd unsymmetric_inverse(const Eigen::MatrixXd& scaled) {
  const Eigen::PartialPivLU<Eigen::MatrixXd> factor(scaled);
  if (factor.rcond() > 1e-13) return factor.inverse();
  return scaled.completeOrthogonalDecomposition().pseudoInverse();
}

bool is_symmetric(const Eigen::MatrixXd& matrix) {
  constexpr Real rounding = 1e-8;
  return (matrix - matrix.transpose()).squaredNorm() <= rounding * rounding * matrix.squaredNorm();
}

/// Inverse of a positive semi-definite matrix, scaled to a unit diagonal first. Unknowns without stiffness get none;
/// where the Cholesky factor fails, directions below 1e-12 of the stiffest are left out.
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix, const std::vector<Real>& diagonal_inverses, int block) {
  const Eigen::Index size = matrix.rows();
  Eigen::VectorXd scale(size);
  const Real largest = size > 0 ? matrix.diagonal().maxCoeff() : 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    scale[i] = matrix(i, i) > 1e-14 * largest ? 1 / std::sqrt(matrix(i, i)) : 0;
  }
  Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  for (Eigen::Index node = 0; node < size / block; ++node) {
    // I - D D^+ spans the directions of a node that have no stiffness: filled, the factor exists.
    const Eigen::MatrixXd part = matrix.block(node * block, node * block, block, block);
    const Eigen::Map<const Eigen::MatrixXd> inverse(diagonal_inverses.data() + node * block * block, block, block);
    const Eigen::MatrixXd idle = Eigen::MatrixXd::Identity(block, block) - part * inverse;
    scaled.block(node * block, node * block, block, block) += 0.5 * (idle + idle.transpose());
  }
  if (!is_symmetric(scaled)) return scale.asDiagonal() * unsymmetric_inverse(scaled) * scale.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> factor(scaled);
  const bool is_sound = factor.info() == Eigen::Success && factor.rcond() > 1e-13;
  if (is_sound) {
    return scale.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(size, size)) * scale.asDiagonal();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);
  Eigen::VectorXd values = solver.eigenvalues();
  const Real least = 1e-12 * values[size - 1];
  for (Real& value : values) value = value > least ? 1 / value : 0;
  const Eigen::MatrixXd vectors = scale.asDiagonal() * solver.eigenvectors();
  return vectors * values.asDiagonal() * vectors.transpose();
}

}  // namespace

template <class T>
CoarsestSolver<T>::CoarsestSolver(const Communicator& comm, MultigridLevel level) : layout_(std::move(level.layout)) {
  const int block = level.values.rows;
  const auto holders = comm.sum(GlobalId{level.graph.rows() > 0 ? 1 : 0});
  is_direct_ = holders <= 1 && layout_.ownership.total() * block <= direct_unknowns;
  b_.assign(index(layout_.owned()) * static_cast<std::size_t>(block), T(0));
  x_.assign(index(layout_.size()) * static_cast<std::size_t>(block), T(0));
  if (is_direct_) {
    if (level.graph.rows() > 0) inverse_ = inverse_of(to_dense(level), level.inverses, block).template cast<T>();
    return;
  }
  graph_ = std::move(level.graph);
  values_ = BlockValues<T>(block, block, graph_.entries());
  std::copy(level.values.values.begin(), level.values.values.end(), values_.values.begin());
  inverses_.assign(level.inverses.begin(), level.inverses.end());
}

template <class T>
void CoarsestSolver<T>::solve() {
  if (!is_direct_) {
    sweep();
    return;
  }
  using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;
  if (b_.empty()) return;
  Eigen::Map<Vector>(x_.data(), inverse_.rows()).noalias() =
      inverse_ * Eigen::Map<const Vector>(b_.data(), inverse_.rows());
}

template <class T>
void CoarsestSolver<T>::sweep() {
  const SweepMatrix<T> matrix{&graph_, &values_, inverses_.data()};
  std::fill(x_.begin(), x_.end(), T(0));
  for (int k = 0; k < sweeps; ++k) {
    sweep_forward(matrix, b_.data(), x_.data());
    layout_.halo.update_copies(std::span(x_), values_.rows);
    sweep_backward(matrix, b_.data(), x_.data());
    layout_.halo.update_copies(std::span(x_), values_.rows);
  }
}

template class CoarsestSolver<float>;
template class CoarsestSolver<double>;

}  // namespace malleus
