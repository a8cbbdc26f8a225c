#pragma once

/// Where the linear solver's options come from: the case, and the -malleus_... options of the PETSc database.

#include "case/run_sections.hpp"
#include "solvers/stokes_linear_solver.hpp"

namespace malleus {

/// Those of [solver] linear_method.
LinearSolverOptions linear_options(LinearChoice choice);

/// Replaces what the user set in the database; InputError for a wrong value. Alike on all ranks.
void read_database(LinearSolverOptions& options);

}  // namespace malleus
