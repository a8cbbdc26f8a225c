#pragma once

/// Failures on purpose, to see that a failure of one rank ends all of them.

#include <string_view>

namespace malleus {

/// Tells which rank this process is. Before it no failure happens.
void set_fault_rank(int rank);

/// Throws, where the environment variable MALLEUS_FAIL_AT = RANK:PHASE:CALL[:KIND] asks for it, at the CALL-th (from 1)
/// passage of that rank through that phase; else does nothing. Phases: `agreement` (each call of agree()), `new_mesh`
/// (a remesh that has begun) and the names of summary.json's components. KIND: storage (default), input, defect or
/// memory. The variable is read once. Local.
void pass_fault_point(std::string_view phase);

}  // namespace malleus
