#pragma once

/// Forces that other parts (contact, friction, surface effects) add to a Stokes step.

#include <span>

#include "fem/node_constraints.hpp"
#include "fem/node_space.hpp"
#include "fem/system_matrix.hpp"

namespace malleus {

/// Takes the parts of a tangent, node by node; projects them on the free directions and sums them over the ranks.
class TangentSink {
 public:
  TangentSink(const NodeConstraints& constraints, SystemMatrix& matrix)
      : constraints_(&constraints), matrix_(&matrix) {}
  /// Adds d force(row) / d velocity(column) [N.s/m]. block: [dim][dim] by rows (force component first). Nodes in the
  /// numbering of the NodeSpace, coupled by an element of this rank or by a tuple of extra_couplings(). The sum of all
  /// blocks must be symmetric.
  void add(LocalId row, LocalId column, const Real* block);

 private:
  const NodeConstraints* constraints_;
  SystemMatrix* matrix_;
};

/// How a term with branches (a contact holds or is open) is evaluated.
enum class Branches {
  follow,  ///< each evaluation takes the branches of its own unknowns
  hold,    ///< from now on those of the unknowns given with the choice: the term is smooth then
  carry    ///< from now on those held last, or that it was made with
};

/// Forces on nodes as a function of the velocities and pressures, with their derivative. Each force is added by one
/// rank only, to any nodes that it holds.
class ResidualTerm {
 public:
  virtual ~ResidualTerm() = default;

  /// Couplings beyond those by elements, by global node numbers; all nodes of a tuple get local numbers in the
  /// NodeSpace of the rank that names it. Asked once a step, before the residual. Local.
  virtual void extra_couplings(NodeTuples& tuples) const { (void)tuples; }

  /// Adds the resisting forces [N], that is minus those which act on the material, in the sense of the momentum
  /// residual: integral of sigma:eps(w) + this = 0. unknowns: [node][dim+1], (v_1..v_dim [m/s], p [Pa]), valid on all
  /// nodes of the space. force: [node][dim]. Local.
  virtual void add_residual(const NodeSpace& space, std::span<const Real> unknowns, std::span<Real> force) const = 0;

  /// Adds the derivative of add_residual() by the velocities, symmetric positive. Local.
  virtual void add_tangent(const NodeSpace& space, std::span<const Real> unknowns, TangentSink& sink) const = 0;

  /// Chooses how branches are taken; a term without any does nothing. unknowns as in add_residual(). Local.
  virtual void choose_branches(Branches choice, const NodeSpace& space, std::span<const Real> unknowns) {
    (void)choice, (void)space, (void)unknowns;
  }

  /// Neither forces nor their derivative depend on the velocity but linearly; the same on all ranks.
  virtual bool is_linear() const { return false; }
};

}  // namespace malleus
