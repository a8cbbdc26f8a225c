#pragma once

/// PETSc's GAMG for the velocity block: second opinion and baseline.

#include "solvers/multigrid/velocity_multigrid.hpp"

namespace malleus {

/// GAMG with rigid-body modes (or translations) and a threshold of 0.01, one V-cycle an application. level: as for
/// make_velocity_multigrid(). Options with the prefix "velocity_" act on it, -velocity_pc_type hypre takes BoomerAMG.
/// Collective.
std::unique_ptr<VelocityMultigrid> make_gamg_velocity(const Communicator& comm, const MultigridLevel& level,
                                                      const NodeConstraints& constraints, bool rigid_modes);

}  // namespace malleus
