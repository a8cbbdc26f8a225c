#include "parallel/session.hpp"

#include <fmt/format.h>
#include <petscsys.h>

namespace malleus {
namespace {

/// PETSc reads its options from an argument vector whose first word is the program's name.
void start_petsc(const char* program, const std::vector<std::string>& options) {
  std::vector<std::string> words = {program};
  words.insert(words.end(), options.begin(), options.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  int count = static_cast<int>(words.size());
  char** arguments = pointers.data();
  PetscInitialize(&count, &arguments, nullptr, nullptr);
  PetscPopSignalHandler();
}

}  // namespace

Session::Session(int& argc, char**& argv, const std::vector<std::string>& petsc_options) {
  MPI_Init(&argc, &argv);
  MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_ARE_FATAL);
  start_petsc(argc > 0 ? argv[0] : "malleus", petsc_options);
  world_ = std::make_unique<Communicator>(MPI_COMM_WORLD);
}

Session::~Session() {
  world_.reset();
  PetscFinalize();
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
