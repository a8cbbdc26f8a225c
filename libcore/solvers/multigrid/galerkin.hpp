#pragma once

/// The coarse operator P^T A P of a distributed level.

#include "solvers/multigrid/coarse_space.hpp"

namespace malleus {

/// Fills layout, graph and values of `coarse` with P^T A P; rows go to the owners of the coarse nodes. Contributions
/// are summed in rank order, so they repeat bit for bit. Collective.
void make_coarse_operator(const Communicator& comm, const MultigridLevel& fine, const Prolongator& prolongator,
                          MultigridLevel& coarse);

}  // namespace malleus
