#pragma once

/// The block-triangular preconditioner of Stokes systems.

#include <Eigen/Dense>
#include <memory>
#include <string>

#include "solvers/bordered_operator.hpp"
#include "solvers/lubrication_block.hpp"
#include "solvers/multigrid/velocity_multigrid.hpp"
#include "solvers/preconditioner_settings.hpp"
#include "solvers/pressure_block.hpp"
#include "solvers/soft_pockets.hpp"

namespace malleus {

/// The settings with `automatic` replaced by what the viscosities of the system ask for. Collective.
PreconditionerSettings resolve(PreconditionerSettings settings, const LinearSystem& system);

/// z_p = -(S^-1 + sum_k e_k e_k^T / E_k) r_p, z_q = E^-1 r_q, z_v = A^-1 (r_v - B^T z_p - g z_q): A^-1 one multigrid
/// cycle, S = M(1/eta)/2 + C by Chebyshev steps, E = d - g^T A^-1 g; e_k is 1 on the nodes of closed soft pocket k (or
/// a part of one), E_k = 1.5 (V_k/eta + the same of the elements around it) + e_k^T C e_k. Where walls make long thin
/// sections, (z_p, z_q) also has the part of LubricationBlock. With the exact blocks a Krylov method would need a few
/// iterations; it needs 16 to 19 with these, up to 900,000 nodes. Holds no reference to the system it was made from.
class StokesPreconditioner {
 public:
  /// settings: resolved. Collective.
  StokesPreconditioner(const BorderedOperator& op, const PreconditionerSettings& settings);

  /// The system that the vectors belong to: of the pattern it was made for, values may differ. Must outlive apply().
  void attach(const BorderedOperator& op) { operator_ = &op; }
  void apply(const Real* residual, Real* correction);  ///< collective

  std::string summary() const;  ///< one line for the log
  std::string table() const;    ///< one line a level
  std::size_t bytes() const;    ///< held by this rank

 private:
  void find_pockets(const LinearSystem& system);
  std::vector<Real> pocket_compliance(std::size_t count) const;
  void add_pockets(const Real* residual);
  void make_border_block();
  Eigen::VectorXd solve_pressures(const Real* residual);
  template <int D>
  void subtract_gradient();  ///< B^T of the pressure's correction, from the velocity's residual
  void solve_velocity(std::vector<Real>& right_side, Real* correction);

  PreconditionerSettings settings_;
  const BorderedOperator* operator_;
  StokesBlocks blocks_;  ///< without the velocity's values once the multigrid has them
  std::unique_ptr<PressureBlock> pressure_;
  std::unique_ptr<LubricationBlock> lubrication_;  ///< null where there are no long thin sections
  std::unique_ptr<VelocityMultigrid> velocity_;
  Eigen::MatrixXd border_inverse_;
  std::vector<Real> pocket_weights_;  ///< [pocket] 1/E of its constant pressure, in the blocks' scaling
  /// [0: pockets, 1: parts of pockets][node], with copies; -1 = none; empty without pockets
  std::vector<std::vector<GlobalId>> pocket_of_node_;
  int open_regions_ = 0;
  std::vector<float> pressure_residual_;    ///< [owned node]
  std::vector<float> pressure_correction_;  ///< [node], with copies
  std::vector<Real> velocity_residual_;     ///< [owned node][dim]
  std::vector<Real> velocity_correction_;
};

inline constexpr const char* stokes_preconditioner_type = "malleus_stokes";

/// Registers the PETSc type "malleus_stokes"; once per process is enough, more do no harm.
void register_stokes_preconditioner();

/// Makes a PC of that type apply `preconditioner`, which must outlive it; does nothing to other types.
void use_stokes_preconditioner(PC pc, StokesPreconditioner& preconditioner);

}  // namespace malleus
