#pragma once

/// The -malleus_... options of the PETSc database.

#include "solvers/stokes_linear_solver.hpp"

namespace malleus {

/// Replaces what the user set in the database; InputError for a wrong value. Alike on all ranks.
void read_database(LinearSolverOptions& options);

}  // namespace malleus
