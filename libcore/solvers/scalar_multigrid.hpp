#pragma once

/// Scalar elliptic problems between the pressures of the nodes: conjugate gradients, and a multigrid cycle.

#include <functional>
#include <memory>

#include "solvers/multigrid/velocity_multigrid.hpp"

namespace malleus {

/// A symmetric matrix with an entry for each of a graph's, positive definite on the rows whose diagonal is not zero;
/// those with a zero diagonal are left out, and so are their columns. Communicator, layout and graph must outlive it.
struct ScalarMatrix {
  const Communicator& comm;
  const BlockLayout& layout;
  const BlockGraph& graph;
  std::vector<Real> values;  ///< [entry]

  Real diagonal(LocalId row) const {
    return values[static_cast<std::size_t>(graph.diagonals[static_cast<std::size_t>(row)])];
  }
};

/// correction from residual, symmetric and positive; [owned node].
using ScalarPreconditioner = std::function<void(const Real* residual, Real* correction)>;

/// Conjugate gradients from zero to ||b - A x|| <= tolerance ||b||, or as far as `most` iterations reach; x.b is then
/// below its exact value. b: [owned node], zero where a row is left out. Collective.
std::vector<Real> solve_conjugate_gradients(const ScalarMatrix& matrix, const std::vector<Real>& b,
                                            const ScalarPreconditioner& precondition, Real tolerance, int most);

/// The same with the inverse diagonal for preconditioner. Collective.
std::vector<Real> solve_conjugate_gradients(const ScalarMatrix& matrix, const std::vector<Real>& b, Real tolerance,
                                            int most);

/// A multigrid of symmetric cycles in single precision for the matrix, which is not needed after. Collective.
std::unique_ptr<VelocityMultigrid> make_scalar_multigrid(const ScalarMatrix& matrix);

}  // namespace malleus
