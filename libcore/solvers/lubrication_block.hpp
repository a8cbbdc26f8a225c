#pragma once

/// The part of the Schur complement that long thin sections make: flow along them is resisted by the walls.

#include <Eigen/Dense>
#include <memory>

#include "solvers/bordered_operator.hpp"
#include "solvers/scalar_multigrid.hpp"
#include "solvers/stokes_blocks.hpp"

namespace malleus {

/// Over distances below the gap H between walls, B A^-1 B^T is the mass M(1/eta)/2. Over longer ones the flow is
/// Hele-Shaw's, v = -psi grad p with psi ~ H^2/(12 eta), and B A^-1 B^T becomes (grad q, psi grad p): smaller by
/// (H/wavelength)^2, which costs a Krylov method iterations in proportion to length over gap. As of Cahouet and Chabard
/// (1988) for unsteady flow, the inverses of both limits are added. psi is the speed under a unit force, the solution
/// of
///
///     rho/dt psi - div(eta grad psi) = 1,   psi = 0 at nodes held in all directions,
///
/// which knows gaps and viscosities wherever they change, and what inertia resists in a step of time, as they meant it.
/// Where the pressure pushes on an opening (vents, gates), and where a border's pressure q stands against it, it meets
/// the resistance of the flow's development over about H: an exchange of 0.7 sqrt(psi/eta) (p - q) per area, q = 0
/// outside. The borders are then eliminated exactly.
class LubricationBlock {
 public:
  /// Null where no node is held and nothing has inertia, or where the gaps are not small against the domain. The layout
  /// and the graph of `blocks` must outlive the result, whose numbers are in the blocks' scaling. Collective.
  static std::unique_ptr<LubricationBlock> make_where_thin(const BorderedOperator& op, const StokesBlocks& blocks);

  /// Adds factor times the block's inverse on (residual_p, residual_q): corrections of owned nodes, and of the borders.
  /// Collective.
  void add(const Real* residual, std::span<const Real> border_residual, Real factor, std::vector<float>& correction,
           Eigen::VectorXd& border_correction);

  std::size_t bytes() const;

 private:
  LubricationBlock() = default;

  const Communicator* comm_ = nullptr;
  std::unique_ptr<VelocityMultigrid> cycle_;
  std::vector<std::vector<Real>> columns_;  ///< [border][owned node]: pressures that a unit q makes
  Eigen::MatrixXd border_inverse_;
  std::vector<Real> corrected_;
};

}  // namespace malleus
