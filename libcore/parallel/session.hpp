#pragma once

/// Start and end of MPI for a process.

#include <memory>
#include <string>

#include "parallel/communicator.hpp"

namespace malleus {

/// Starts MPI at construction and ends it at destruction. One per process.
class Session {
 public:
  Session(int& argc, char**& argv);
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
