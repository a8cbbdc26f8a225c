#include "parallel/session.hpp"

#include <fmt/format.h>
#include <petscversion.h>

namespace malleus {

Session::Session(int& argc, char**& argv) {
  MPI_Init(&argc, &argv);
  MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_ARE_FATAL);
  world_ = std::make_unique<Communicator>(MPI_COMM_WORLD);
}

Session::~Session() {
  world_.reset();
  MPI_Finalize();
}

std::string parallel_library_versions() {
  char mpi[MPI_MAX_LIBRARY_VERSION_STRING];
  int length = 0;
  MPI_Get_library_version(mpi, &length);
  const std::string text(mpi, static_cast<std::size_t>(length));
  return fmt::format("PETSc {}.{}.{}, {}", PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR,
                     text.substr(0, text.find(',')));
}

}  // namespace malleus
