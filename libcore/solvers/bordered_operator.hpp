#pragma once

/// The operator [K g; g^T d] of a LinearSystem for PETSc, and its vectors.

#include "fem/linear_system.hpp"
#include "solvers/petsc_objects.hpp"

namespace malleus {

/// Vectors hold the owned nodes in blocks of dim+1, and on the root the border unknowns after them. The system must
/// outlive the operator.
class BorderedOperator {
 public:
  explicit BorderedOperator(const LinearSystem& system);  ///< collective
  BorderedOperator(const BorderedOperator&) = delete;
  BorderedOperator& operator=(const BorderedOperator&) = delete;

  /// K itself where there is no border, else a shell matrix; carries the null space where the pressure is free.
  Mat matrix() const { return shell_ ? shell_.get() : system_.matrix; }
  MatNullSpace null_space() const { return null_space_.get(); }  ///< null where there is none
  const LinearSystem& system() const { return system_; }
  int borders() const { return static_cast<int>(system_.borders.size()); }
  std::size_t node_unknowns() const { return node_unknowns_; }  ///< on this rank

  PetscVector make_vector() const;                         ///< collective
  void fill(const LinearVector& from, Vec to) const;       ///< local
  void extract(Vec from, LinearVector& to) const;          ///< collective
  void multiply(const Real* x, Real* y) const;             ///< y = [K g; g^T d] x; collective
  std::vector<Real> border_values(const Real* x) const;    ///< on all ranks; collective
  std::vector<Real> border_products(const Real* x) const;  ///< g_j^T x_v of each column, on all ranks; collective
  void add_borders(std::span<const Real> q, Real factor, Real* y) const;   ///< y_v += factor sum_j g_j q_j; local
  void subtract_borders(std::span<const Real> q, Real* velocities) const;  ///< [owned node][dim], v -= g q; local

 private:
  void make_shell();
  void make_null_space();

  const LinearSystem& system_;
  std::size_t node_unknowns_ = 0;
  bool holds_borders_ = false;
  PetscMatrix shell_;
  PetscVector inner_x_;  ///< views on the nodes' part of vectors
  PetscVector inner_y_;
  PetscNullSpace null_space_;
};

}  // namespace malleus
