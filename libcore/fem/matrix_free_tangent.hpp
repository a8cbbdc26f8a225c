#pragma once

/// Products of a tangent with vectors, element by element, without its matrix.

#include <petscmat.h>

#include <span>
#include <vector>

#include "fem/node_constraints.hpp"
#include "mesh/mesh.hpp"
#include "parallel/petsc.hpp"

namespace malleus {

/// What the products depend on; all of it must outlive them and stay as it is.
struct MatrixFreeCoefficients {
  std::span<const Real> viscosity;  ///< [element], Pa.s; 0 = not modelled
  std::span<const Real> slope;      ///< [element], (d eta / d gamma) / gamma, Pa.s^3; empty: Picard's matrix
  std::span<const Real> state;      ///< [local node][dim+1], where the slope is taken; needed with it only
  std::vector<Real> force;          ///< [element][dim], N/m^3, of the loads; empty = none; used with follows_subscales
  bool follows_subscales = false;   ///< Tangent::newton: the subscales follow the viscosity
  Real pressure_scale = 1;          ///< see LinearSystem
  Real fixed_stiffness = 1;         ///< d of fixed directions, and -d of fixed pressures
};

/// The matrix of a LinearSystem as a MATSHELL that knows its products alone: those of plane scenes and of three
/// dimensions, without terms and without inertia. Takes some 200 bytes a node where the matrix takes 2,000, and
/// several times as long for a product. Mesh and constraints must outlive it.
class MatrixFreeTangent {
 public:
  MatrixFreeTangent(const Communicator& comm, const Mesh& mesh, const NodeConstraints& constraints,
                    MatrixFreeCoefficients coefficients);
  MatrixFreeTangent(const MatrixFreeTangent&) = delete;
  MatrixFreeTangent& operator=(const MatrixFreeTangent&) = delete;

  Mat matrix() const { return shell_.get(); }
  /// y = K x, [owned node][dim+1]. Collective among neighbours.
  void multiply(const Real* x, Real* y);

 private:
  template <int D>
  void add_elements();

  const Mesh& mesh_;
  const NodeConstraints& constraints_;
  MatrixFreeCoefficients coefficients_;
  std::vector<Real> in_, out_;  ///< [local node][dim+1]
  PetscOwner<Mat, MatDestroy> shell_;
};

}  // namespace malleus
