#pragma once

/// The linear system of a Stokes step, as the linear solver gets it.

#include <petscmat.h>

#include <cstdint>
#include <span>
#include <vector>

#include "fem/node_constraints.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// One more scalar unknown q (the pressure of a flow-rate gate, of a closed pocket): a column g over the velocities
/// and the row g^T. Same number of columns, in the same order, on all ranks.
struct BorderColumn {
  std::vector<LocalId> nodes;  ///< owned nodes where g is not zero, increasing
  std::vector<Real> values;    ///< [node of `nodes`][dim], scaled and projected on the free directions
  Real diagonal = 0;  ///< <= 0: entry of the unknown's own row (compressible pocket), scaled; same on all ranks
};

/// Makes the entries of a matrix that is kept by its products alone.
class MatrixEntries {
 public:
  virtual ~MatrixEntries() = default;
  virtual Mat assemble() = 0;  ///< a BAIJ matrix, valid until release(). Collective.
  virtual void release() = 0;  ///< frees it
};

/// Unknowns and equations of a linear solve.
///
///     [ A   B^T  g ] [dv]   [r_v]      A positive on the free directions (viscous, friction, penalty, inertia)
///     [ B+E -C   0 ] [dp] = [r_p]      B = -(q, div v): r_p in m^3/s times the scale; E of Newton's tangent only
///     [ g^T  0   d ] [dq]   [r_q]      C from the subscales, >= 0
///
/// A is symmetric but for convection, which also adds to B^T and B.
///
/// `matrix` holds [A B^T; B -C] in blocks of dim+1 a node, (v_1..v_dim, p): MATSEQBAIJ on one rank, MATMPIBAIJ on
/// several; or a shell, see `entries`. Rows and columns are the global node numbers of the mesh; a rank has the rows of
/// the nodes it owns. Pressures are scaled: the unknowns are p/s and q/s, s = `pressure_scale` [Pa.s/m]; so B, g carry
/// s and C carries s^2: the dimensionless equations, whose residual weighs force and volume alike on any mesh. Fixed
/// directions: A = P A' P + (I - P) d, B = B' P (see NodeConstraints), in global axes; right sides and solutions have
/// no part along them. Nodes that touch no modelled element are fully fixed, with -d in the pressure's row.
struct LinearSystem {
  const Communicator* comm = nullptr;
  const Mesh* mesh = nullptr;  ///< for coordinates (rigid modes), elements, halo
  /// Not owned, not to be changed. Beware of MatConvert(): PETSc 3.18 takes an MPIBAIJ matrix apart to convert it.
  Mat matrix = nullptr;
  MatrixEntries* entries = nullptr;              ///< where the matrix is a shell that knows products alone; else null
  const NodeConstraints* constraints = nullptr;  ///< of the mesh's local nodes: owned, then copies
  std::span<const Real> element_viscosity;       ///< [element] Pa.s; 0 = not modelled, adds nothing to the matrix
  std::span<const Real> element_volume;          ///< [element] m^3; in axisymmetric scenes of the whole ring
  /// [element] kg/(m^3 s), density times the rate of dv/dt: what resists beside the viscosity; empty = nothing.
  std::span<const Real> element_inertia;
  std::vector<BorderColumn> borders;
  Real pressure_scale = 1;
  bool axisymmetric = false;
  /// The pressure, with all q, is determined up to a constant: the null vector is 1 in every pressure that is not
  /// fixed and in every border unknown. Right sides are then orthogonal to it up to rounding, or to quadrature.
  bool pressure_is_free = false;
  std::uint64_t pattern_version = 0;  ///< changes with mesh and couplings
  std::uint64_t value_version = 0;    ///< changes with the entries

  int block_size() const noexcept { return mesh->dim + 1; }
};

/// The matrix of a system with its entries, which may be made for the lifetime of the object alone.
class AssembledMatrix {
 public:
  explicit AssembledMatrix(const LinearSystem& system)  ///< collective
      : entries_(system.entries), matrix_(entries_ == nullptr ? system.matrix : entries_->assemble()) {}
  AssembledMatrix(const AssembledMatrix&) = delete;
  AssembledMatrix& operator=(const AssembledMatrix&) = delete;
  ~AssembledMatrix() {
    if (entries_ != nullptr) entries_->release();
  }
  Mat get() const noexcept { return matrix_; }

 private:
  MatrixEntries* entries_;
  Mat matrix_;
};

/// A right side or a solution: owned nodes, and the border unknowns (the same on all ranks).
struct LinearVector {
  std::vector<Real> nodes;    ///< [owned node][dim+1]
  std::vector<Real> borders;  ///< [border]
};

}  // namespace malleus
