#pragma once

/// The outermost frame of every executable: MPI, PETSc where it is wanted, and how errors leave the program.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Arguments without the program's name, and without what follows `--` where that goes to PETSc. Returns the exit code.
using Program = std::function<int(const Communicator& comm, const std::vector<std::string>& arguments)>;

class PetscSession;
using StartPetsc = std::shared_ptr<PetscSession>(const char* program, const std::vector<std::string>& options);

/// Starts MPI, and PETSc where start_petsc is given (a program that does not is not linked with it), runs the program
/// and returns its exit code. An Error that all ranks raise alike is printed once, by the root, as "error: ..."; one
/// that a single rank met ends all ranks with its message and code. A Defect, or any foreign exception, is printed with
/// its rank and ends all ranks with exit code 1.
int run_guarded(int argc, char** argv, const Program& program, StartPetsc* start_petsc = nullptr);

}  // namespace malleus
