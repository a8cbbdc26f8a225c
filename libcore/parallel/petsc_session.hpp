#pragma once

/// Start and end of PETSc, for programs that solve: loading it and what it is linked with takes a tenth of a second.

#include <memory>
#include <string>
#include <vector>

namespace malleus {

/// PETSc from construction to destruction, within a Session's life. One per process.
class PetscSession {
 public:
  /// options: what the user gave after `--`, as words.
  PetscSession(const char* program, const std::vector<std::string>& options);
  PetscSession(const PetscSession&) = delete;
  PetscSession& operator=(const PetscSession&) = delete;
  ~PetscSession();
};

/// For run_guarded(). Collective.
std::shared_ptr<PetscSession> start_petsc(const char* program, const std::vector<std::string>& options);

}  // namespace malleus
