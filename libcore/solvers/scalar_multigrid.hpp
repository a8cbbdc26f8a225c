#pragma once

/// Scalar elliptic problems between the pressures of the nodes: a multigrid cycle, and conjugate gradients around it.

#include <memory>

#include "solvers/multigrid/velocity_multigrid.hpp"

namespace malleus {

/// A symmetric matrix with an entry for each of a graph's, positive definite on the rows whose diagonal is not zero.
/// Layout, graph and communicator must outlive it.
class ScalarMultigrid {
 public:
  /// values: [entry]. Rows and columns with a zero diagonal are left out and get no correction. Collective.
  ScalarMultigrid(const Communicator& comm, const BlockLayout& layout, const BlockGraph& graph,
                  std::vector<Real> values);

  /// One symmetric cycle in single precision, from zero. [owned node]. Collective among neighbours.
  void apply(const Real* residual, Real* correction) { cycle_->apply(residual, correction); }

  /// Conjugate gradients from zero to ||b - A x|| <= tolerance ||b||, or to the best of `most` iterations. With an
  /// approximate x the energy b.x is below the exact one. [owned node]. Collective.
  std::vector<Real> solve(const std::vector<Real>& b, Real tolerance, int most) const;

  std::size_t bytes() const { return cycle_->bytes() + sizeof(Real) * values_.size(); }
  /// Gives up the matrix; apply() remains. Local.
  void forget_matrix() { values_ = {}; }

 private:
  void multiply(std::vector<Real>& x, std::vector<Real>& y) const;
  Real dot(const std::vector<Real>& a, const std::vector<Real>& b) const;

  const Communicator& comm_;
  const BlockLayout& layout_;
  const BlockGraph& graph_;
  std::vector<Real> values_;
  std::unique_ptr<VelocityMultigrid> cycle_;
};

}  // namespace malleus
