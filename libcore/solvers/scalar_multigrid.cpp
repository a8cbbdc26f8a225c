#include "solvers/scalar_multigrid.hpp"

#include <cmath>
#include <numeric>

namespace malleus {
namespace {

std::size_t index(LocalId i) {
  return static_cast<std::size_t>(i);
}

}  // namespace

ScalarMultigrid::ScalarMultigrid(const Communicator& comm, const BlockLayout& layout, const BlockGraph& graph,
                                 std::vector<Real> values)
    : comm_(comm), layout_(layout), graph_(graph), values_(std::move(values)) {
  MultigridLevel finest;
  finest.layout = layout;
  finest.graph = graph;
  finest.values = BlockValues<Real>(1, 1, graph.entries());
  std::copy(values_.begin(), values_.end(), finest.values.values.begin());
  finest.points.assign(index(graph.rows()), 0.0);
  finest.left_out.resize(index(graph.rows()));
  for (LocalId row = 0; row < graph.rows(); ++row) {
    finest.left_out[index(row)] = !(values_[index(graph.diagonals[index(row)])] > 0);
  }
  cycle_ = make_scalar_multigrid(comm, std::move(finest), MultigridSettings{});
}

/// x: with room for the copies.
void ScalarMultigrid::multiply(std::vector<Real>& x, std::vector<Real>& y) const {
  layout_.halo.update_copies(std::span(x), 1);
  for (LocalId row = 0; row < graph_.rows(); ++row) {
    Real sum = 0;
    for (LocalId k = graph_.offsets[index(row)]; k < graph_.offsets[index(row) + 1]; ++k) {
      sum += values_[index(k)] * x[index(graph_.columns[index(k)])];
    }
    y[index(row)] = sum;
  }
}

Real ScalarMultigrid::dot(const std::vector<Real>& a, const std::vector<Real>& b) const {
  return comm_.sum(std::inner_product(a.begin(), a.begin() + graph_.rows(), b.begin(), 0.0));
}

std::vector<Real> ScalarMultigrid::solve(const std::vector<Real>& b, Real tolerance, int most) const {
  const auto rows = index(graph_.rows());
  std::vector<Real> x(rows, 0.0);
  std::vector<Real> residual = b;
  std::vector<Real> corrected(rows);
  std::vector<Real> product(rows);
  std::vector<Real> direction(index(layout_.size()), 0.0);
  const Real goal = tolerance * std::sqrt(dot(b, b));
  Real energy = 0;
  for (int iteration = 0; iteration < most && std::sqrt(dot(residual, residual)) > goal; ++iteration) {
    cycle_->apply(residual.data(), corrected.data());
    const Real next = dot(residual, corrected);
    const Real share = energy > 0 ? next / energy : 0;
    energy = next;
    for (std::size_t i = 0; i < rows; ++i) direction[i] = corrected[i] + share * direction[i];
    multiply(direction, product);
    const Real curvature = dot(direction, product);
    if (!(energy > 0) || !(curvature > 0)) break;
    for (std::size_t i = 0; i < rows; ++i) {
      x[i] += energy / curvature * direction[i];
      residual[i] -= energy / curvature * product[i];
    }
  }
  return x;
}

}  // namespace malleus
