#include "engine/petsc_options.hpp"

#include "parallel/petsc.hpp"

namespace malleus {

std::vector<std::string> unused_petsc_options() {
  PetscInt count = 0;
  char** names = nullptr;
  char** values = nullptr;
  petsc_call(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  std::vector<std::string> options;
  for (PetscInt i = 0; i < count; ++i) {
    options.push_back(std::string("-") + names[i] + (values[i] != nullptr ? std::string(" ") + values[i] : ""));
  }
  petsc_call(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  return options;
}

}  // namespace malleus
