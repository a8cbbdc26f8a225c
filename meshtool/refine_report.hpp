#pragma once

/// What `meshtool refine` tells about its work.

#include <vector>

#include "meshtool/refine_options.hpp"
#include "remesh/distributed.hpp"

namespace malleus::meshtool {

/// Prints the result and writes the report file, if one was asked for. phases: reading and writing, wall time of the
/// slowest rank. StorageError. Collective.
void report_refinement(const Communicator& comm, const RefineOptions& options, const DistributedRemeshReport& report,
                       const std::vector<RemeshPhase>& phases);

}  // namespace malleus::meshtool
