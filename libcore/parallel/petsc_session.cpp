#include "parallel/petsc_session.hpp"

#include <petscsys.h>

namespace malleus {

/// PETSc reads its options from an argument vector whose first word is the program's name.
PetscSession::PetscSession(const char* program, const std::vector<std::string>& options) {
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

PetscSession::~PetscSession() {
  PetscFinalize();
}

std::shared_ptr<PetscSession> start_petsc(const char* program, const std::vector<std::string>& options) {
  return std::make_shared<PetscSession>(program, options);
}

}  // namespace malleus
