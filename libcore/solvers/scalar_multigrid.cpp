#include "solvers/scalar_multigrid.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/index.hpp"

namespace malleus {
namespace {

/// y = A x on the owned rows; x has room for the copies and gets their values.
void multiply(const ScalarMatrix& matrix, std::vector<Real>& x, std::vector<Real>& y) {
  matrix.layout.halo.update_copies(std::span(x), 1);
  for (LocalId row = 0; row < matrix.graph.rows(); ++row) {
    Real sum = 0;
    for (LocalId k = matrix.graph.offsets[index(row)]; k < matrix.graph.offsets[index(row) + 1]; ++k) {
      sum += matrix.values[index(k)] * x[index(matrix.graph.columns[index(k)])];
    }
    y[index(row)] = sum;
  }
}

/// Coupled with no other node, as those of elements that are not modelled: a sweep solves its row. On coarse levels
/// such nodes would be aggregates of one, too many of them to go on.
bool is_alone(const ScalarMatrix& matrix, LocalId row) {
  for (LocalId k = matrix.graph.offsets[index(row)]; k < matrix.graph.offsets[index(row) + 1]; ++k) {
    if (matrix.graph.columns[index(k)] != row && matrix.values[index(k)] != 0) return false;
  }
  return true;
}

}  // namespace

std::vector<Real> solve_conjugate_gradients(const ScalarMatrix& matrix, const std::vector<Real>& b,
                                            const ScalarPreconditioner& precondition, Real tolerance, int most) {
  const auto rows = index(matrix.graph.rows());
  const auto dot = [&](const std::vector<Real>& u, const std::vector<Real>& v) {
    return matrix.comm.sum(std::inner_product(u.begin(), u.begin() + matrix.graph.rows(), v.begin(), 0.0));
  };
  std::vector<Real> x(rows, 0.0);
  std::vector<Real> residual = b;
  std::vector<Real> corrected(rows);
  std::vector<Real> product(rows);
  std::vector<Real> direction(index(matrix.layout.size()), 0.0);
  const Real goal = tolerance * std::sqrt(dot(b, b));
  Real energy = 0;
  for (int iteration = 0; iteration < most && std::sqrt(dot(residual, residual)) > goal; ++iteration) {
    precondition(residual.data(), corrected.data());
    const Real next = dot(residual, corrected);
    const Real share = energy > 0 ? next / energy : 0;
    energy = next;
    for (std::size_t i = 0; i < rows; ++i) direction[i] = corrected[i] + share * direction[i];
    multiply(matrix, direction, product);
    const Real curvature = dot(direction, product);
    if (!(energy > 0) || !(curvature > 0)) break;
    for (std::size_t i = 0; i < rows; ++i) {
      x[i] += energy / curvature * direction[i];
      residual[i] -= energy / curvature * product[i];
    }
  }
  return x;
}

std::vector<Real> solve_conjugate_gradients(const ScalarMatrix& matrix, const std::vector<Real>& b, Real tolerance,
                                            int most) {
  const auto by_diagonal = [&](const Real* residual, Real* correction) {
    for (LocalId row = 0; row < matrix.graph.rows(); ++row) {
      const Real diagonal = matrix.diagonal(row);
      correction[row] = diagonal > 0 ? residual[row] / diagonal : 0;
    }
  };
  return solve_conjugate_gradients(matrix, b, by_diagonal, tolerance, most);
}

std::unique_ptr<VelocityMultigrid> make_scalar_multigrid(const ScalarMatrix& matrix) {
  MultigridLevel finest;
  finest.layout = matrix.layout;
  finest.graph = matrix.graph;
  finest.values = BlockValues<Real>(1, 1, matrix.graph.entries());
  std::copy(matrix.values.begin(), matrix.values.end(), finest.values.values.begin());
  finest.points.assign(index(matrix.graph.rows()), 0.0);
  finest.left_out.resize(index(matrix.graph.rows()));
  for (LocalId row = 0; row < matrix.graph.rows(); ++row) {
    finest.left_out[index(row)] = !(matrix.diagonal(row) > 0) || is_alone(matrix, row);
  }
  MultigridSettings settings;
  settings.coarsest_unknowns = 200;
  return make_scalar_multigrid(matrix.comm, std::move(finest), settings);
}

}  // namespace malleus
