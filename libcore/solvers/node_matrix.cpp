#include "solvers/node_matrix.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace malleus {

ElementSlots build_element_slots(const Mesh& mesh, const NodeGraph& graph) {
  check(graph.neighbours.size() < static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()),
        "the matrix of one rank has fewer than 2^31 entries");
  const auto n = static_cast<std::size_t>(mesh.dim) + 1;
  ElementSlots result;
  result.slots.reserve(static_cast<std::size_t>(mesh.elements()) * n * n);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (const LocalId row : nodes) {
      const auto columns = graph.of(row);
      for (const LocalId column : nodes) {
        const auto found = std::lower_bound(columns.begin(), columns.end(), column);
        result.slots.push_back(
            static_cast<std::int32_t>(graph.start[static_cast<std::size_t>(row)] + (found - columns.begin())));
      }
    }
  }
  return result;
}

void multiply(const Mesh& mesh, const NodeGraph& graph, const NodeMatrix& matrix, std::span<const LocalId> rows,
              std::span<const Real> x, std::span<Real> y) {
  for (const LocalId row : rows) {
    const auto r = static_cast<std::size_t>(row);
    Real sum = 0;
    for (auto k = static_cast<std::size_t>(graph.start[r]); k < static_cast<std::size_t>(graph.start[r + 1]); ++k) {
      sum += matrix.entries[k] * x[static_cast<std::size_t>(graph.neighbours[k])];
    }
    y[r] = sum;
  }
  mesh.node_halo.add_to_owners(y, 1);
}

namespace {

/// Vectors of the iteration and the loops over the owned rows.
class BiCgStab {
 public:
  BiCgStab(const Communicator& comm, const NodeSystem& system) : comm_(comm), system_(system) {
    const auto& rows = system.rows;
    const auto end = std::lower_bound(rows.begin(), rows.end(), system.mesh.owned_nodes());
    owned_ = rows.first(static_cast<std::size_t>(end - rows.begin()));
    const auto n = static_cast<std::size_t>(system.mesh.nodes());
    for (auto* vector : {&r_, &r0_, &p_, &v_, &t_, &z_, &diagonal_}) vector->assign(n, 0);
    invert_diagonal();
  }

  NodeSolution run(std::span<const Real> b, std::span<Real> x, Real tolerance, int max_iterations) {
    apply(x, v_);
    for (const LocalId row : owned_) {
      const auto n = static_cast<std::size_t>(row);
      r_[n] = r0_[n] = p_[n] = b[n] - v_[n];
    }
    NodeSolution solution;
    const Real start = std::sqrt(comm_.sum(dot(r_, r_)));
    if (start == 0) return solution;
    solution.residual = 1;
    Real rho = start * start;
    while (solution.residual > tolerance && solution.iterations < max_iterations) {
      ++solution.iterations;
      rho = iterate(x, rho);
      solution.residual = std::sqrt(squared_) / start;
      if (!std::isfinite(rho)) break;
    }
    system_.mesh.node_halo.update_copies(x, 1);
    solution.converged = solution.residual <= tolerance;
    return solution;
  }

 private:
  void invert_diagonal() {
    for (const LocalId row : system_.rows) {
      const auto columns = system_.graph.of(row);
      const auto at = std::lower_bound(columns.begin(), columns.end(), row) - columns.begin();
      diagonal_[static_cast<std::size_t>(row)] =
          system_.matrix.entries[static_cast<std::size_t>(system_.graph.start[static_cast<std::size_t>(row)] + at)];
    }
    system_.mesh.node_halo.add_to_owners(diagonal_, 1);
    for (const LocalId row : owned_) {
      Real& value = diagonal_[static_cast<std::size_t>(row)];
      value = value != 0 ? 1 / value : 1;
    }
  }

  void apply(std::span<const Real> x, std::vector<Real>& y) const {
    multiply(system_.mesh, system_.graph, system_.matrix, system_.rows, x, y);
  }
  /// z = copies of D^-1 from; y = A z.
  void apply_preconditioned(const std::vector<Real>& from, std::vector<Real>& y) {
    for (const LocalId row : owned_) {
      const auto n = static_cast<std::size_t>(row);
      z_[n] = diagonal_[n] * from[n];
    }
    system_.mesh.node_halo.update_copies(z_, 1);
    apply(z_, y);
  }
  void add_preconditioned(Real factor, std::span<Real> x) const {
    for (const LocalId row : owned_) x[static_cast<std::size_t>(row)] += factor * z_[static_cast<std::size_t>(row)];
  }

  Real dot(const std::vector<Real>& a, const std::vector<Real>& b) const {
    Real sum = 0;
    for (const LocalId row : owned_) sum += a[static_cast<std::size_t>(row)] * b[static_cast<std::size_t>(row)];
    return sum;
  }

  /// One iteration: takes (r0, r), returns the next one; NaN where the method breaks down. Sets squared_ = (r, r).
  Real iterate(std::span<Real> x, Real rho) {
    apply_preconditioned(p_, v_);
    const Real projected = comm_.sum(dot(r0_, v_));
    if (projected == 0) return std::numeric_limits<Real>::quiet_NaN();
    const Real alpha = rho / projected;
    add_preconditioned(alpha, x);
    for (const LocalId row : owned_) r_[static_cast<std::size_t>(row)] -= alpha * v_[static_cast<std::size_t>(row)];
    apply_preconditioned(r_, t_);
    std::array<Real, 2> products = {dot(t_, r_), dot(t_, t_)};
    comm_.sum_in_place(products);
    const Real omega = products[1] > 0 ? products[0] / products[1] : 0;
    add_preconditioned(omega, x);
    for (const LocalId row : owned_) r_[static_cast<std::size_t>(row)] -= omega * t_[static_cast<std::size_t>(row)];
    std::array<Real, 2> norms = {dot(r0_, r_), dot(r_, r_)};
    comm_.sum_in_place(norms);
    squared_ = norms[1];
    if (omega == 0 || rho == 0) return squared_ == 0 ? 0 : std::numeric_limits<Real>::quiet_NaN();
    const Real beta = norms[0] / rho * alpha / omega;
    for (const LocalId row : owned_) {
      const auto n = static_cast<std::size_t>(row);
      p_[n] = r_[n] + beta * (p_[n] - omega * v_[n]);
    }
    return norms[0];
  }

  const Communicator& comm_;
  const NodeSystem& system_;
  std::span<const LocalId> owned_;
  std::vector<Real> r_, r0_, p_, v_, t_, z_, diagonal_;
  Real squared_ = 0;
};

}  // namespace

NodeSolution solve_bicgstab(const Communicator& comm, const NodeSystem& system, std::span<const Real> b,
                            std::span<Real> x, Real tolerance, int max_iterations) {
  return BiCgStab(comm, system).run(b, x, tolerance, max_iterations);
}

}  // namespace malleus
