#include "solvers/bordered_operator.hpp"

#include <algorithm>

#include "parallel/petsc_shell.hpp"

namespace malleus {

BorderedOperator::BorderedOperator(const LinearSystem& system)
    : system_(system),
      node_unknowns_(static_cast<std::size_t>(system.mesh->owned_nodes()) *
                     static_cast<std::size_t>(system.block_size())),
      holds_borders_(system.comm->is_root() && !system.borders.empty()) {
  if (!system.borders.empty()) make_shell();
  if (system.pressure_is_free) make_null_space();
}

void BorderedOperator::make_shell() {
  const auto nodes = static_cast<PetscInt>(node_unknowns_);
  const PetscInt local = nodes + (holds_borders_ ? borders() : 0);
  shell_ = PetscMatrix(make_shell_matrix(system_.comm->raw(), local, *this));
  petsc_call(MatSetOption(shell_.get(), MAT_SYMMETRIC, PETSC_TRUE));
  for (PetscVector* inner : {&inner_x_, &inner_y_}) {
    petsc_call(VecCreateMPIWithArray(system_.comm->raw(), system_.block_size(), nodes, PETSC_DETERMINE, nullptr,
                                     inner->out()));
  }
}

void BorderedOperator::make_null_space() {
  const PetscVector vector = make_vector();
  LinearVector ones{std::vector<Real>(node_unknowns_, 0.0), std::vector<Real>(system_.borders.size(), 1.0)};
  const auto block = static_cast<std::size_t>(system_.block_size());
  for (LocalId node = 0; node < system_.mesh->owned_nodes(); ++node) {
    if (!system_.constraints->is_pressure_fixed(node)) ones.nodes[(static_cast<std::size_t>(node) + 1) * block - 1] = 1;
  }
  fill(ones, vector.get());
  petsc_call(VecNormalize(vector.get(), nullptr));
  Vec basis = vector.get();
  petsc_call(MatNullSpaceCreate(system_.comm->raw(), PETSC_FALSE, 1, &basis, null_space_.out()));
}

PetscVector BorderedOperator::make_vector() const {
  PetscVector vector;
  petsc_call(MatCreateVecs(matrix(), vector.out(), nullptr));
  return vector;
}

void BorderedOperator::fill(const LinearVector& from, Vec to) const {
  check(from.nodes.size() == node_unknowns_ && from.borders.size() == system_.borders.size(),
        "a vector has the size of its system");
  PetscScalar* values = nullptr;
  petsc_call(VecGetArrayWrite(to, &values));
  std::copy(from.nodes.begin(), from.nodes.end(), values);
  if (holds_borders_) std::copy(from.borders.begin(), from.borders.end(), values + node_unknowns_);
  petsc_call(VecRestoreArrayWrite(to, &values));
}

void BorderedOperator::extract(Vec from, LinearVector& to) const {
  const PetscScalar* values = nullptr;
  petsc_call(VecGetArrayRead(from, &values));
  to.nodes.assign(values, values + node_unknowns_);
  to.borders = border_values(values);
  petsc_call(VecRestoreArrayRead(from, &values));
}

void BorderedOperator::multiply(const Real* x, Real* y) const {
  petsc_call(VecPlaceArray(inner_x_.get(), x));
  petsc_call(VecPlaceArray(inner_y_.get(), y));
  petsc_call(MatMult(system_.matrix, inner_x_.get(), inner_y_.get()));
  petsc_call(VecResetArray(inner_x_.get()));
  petsc_call(VecResetArray(inner_y_.get()));
  const std::vector<Real> q = border_values(x);
  const std::vector<Real> products = border_products(x);
  add_borders(q, 1.0, y);
  if (!holds_borders_) return;
  for (std::size_t j = 0; j < q.size(); ++j) {
    y[node_unknowns_ + j] = products[j] + system_.borders[j].diagonal * q[j];
  }
}

std::vector<Real> BorderedOperator::border_values(const Real* x) const {
  std::vector<Real> q(system_.borders.size(), 0.0);
  if (q.empty()) return q;
  if (holds_borders_) std::copy_n(x + node_unknowns_, q.size(), q.begin());
  system_.comm->broadcast(std::span(q));
  return q;
}

std::vector<Real> BorderedOperator::border_products(const Real* x) const {
  const auto dim = static_cast<std::size_t>(system_.mesh->dim);
  std::vector<Real> products(system_.borders.size(), 0.0);
  if (products.empty()) return products;
  for (std::size_t j = 0; j < products.size(); ++j) {
    const BorderColumn& column = system_.borders[j];
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      const Real* v = x + static_cast<std::size_t>(column.nodes[k]) * (dim + 1);
      for (std::size_t d = 0; d < dim; ++d) products[j] += column.values[k * dim + d] * v[d];
    }
  }
  system_.comm->sum_in_place(std::span(products));
  return products;
}

void BorderedOperator::add_borders(std::span<const Real> q, Real factor, Real* y) const {
  const auto dim = static_cast<std::size_t>(system_.mesh->dim);
  for (std::size_t j = 0; j < q.size(); ++j) {
    const BorderColumn& column = system_.borders[j];
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      Real* v = y + static_cast<std::size_t>(column.nodes[k]) * (dim + 1);
      for (std::size_t d = 0; d < dim; ++d) v[d] += factor * column.values[k * dim + d] * q[j];
    }
  }
}

void BorderedOperator::subtract_borders(std::span<const Real> q, Real* velocities) const {
  const auto dim = static_cast<std::size_t>(system_.mesh->dim);
  for (std::size_t j = 0; j < q.size(); ++j) {
    const BorderColumn& column = system_.borders[j];
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      Real* v = velocities + static_cast<std::size_t>(column.nodes[k]) * dim;
      for (std::size_t d = 0; d < dim; ++d) v[d] -= column.values[k * dim + d] * q[j];
    }
  }
}

}  // namespace malleus
