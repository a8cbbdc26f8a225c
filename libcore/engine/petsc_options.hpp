#pragma once

/// What the user gave to PETSc's options database behind `--`.

#include <string>
#include <vector>

namespace malleus {

/// Options with their values, as given, that nothing has asked for so far: misspelt, or of a solver that did not run.
/// Local; the same on all ranks.
std::vector<std::string> unused_petsc_options();

}  // namespace malleus
