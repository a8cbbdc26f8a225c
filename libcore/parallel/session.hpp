#pragma once

/// Start and end of MPI and PETSc for a process.

#include <memory>
#include <string>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Starts MPI and PETSc at construction and ends them at destruction. One per process.
class Session {
 public:
  /// petsc_options: what the user gave after `--`, as words.
  Session(int& argc, char**& argv, const std::vector<std::string>& petsc_options);
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  ~Session();

  const Communicator& world() const { return *world_; }

 private:
  std::unique_ptr<Communicator> world_;
};

/// "PETSc 3.18.5, Open MPI v4.1.4", say. Local; may be called before a Session.
std::string parallel_library_versions();

}  // namespace malleus
