#include "solvers/linear_database.hpp"

#include <fmt/format.h>
#include <petscsys.h>

#include <array>
#include <string>

#include "parallel/petsc.hpp"

namespace malleus {
namespace {

/// Sets `value` to the number of the word that the option was given, where it was given.
template <class Enumeration, std::size_t N>
void read_choice(const char* name, const std::array<const char*, N>& words, Enumeration& value) {
  std::array<char, 64> text{};
  PetscBool is_set = PETSC_FALSE;
  petsc_call(PetscOptionsGetString(nullptr, nullptr, name, text.data(), text.size(), &is_set));
  if (is_set == PETSC_FALSE) return;
  std::string known;
  for (std::size_t i = 0; i < N; ++i) {
    if (std::string(text.data()) == words[i]) {
      value = static_cast<Enumeration>(i);
      return;
    }
    known += (i > 0 ? ", " : "") + std::string(words[i]);
  }
  throw InputError(fmt::format("option {} is '{}'; it is one of {}", name, text.data(), known));
}

void read_integer(const char* name, int low, int& value) {
  PetscInt given = value;
  petsc_call(PetscOptionsGetInt(nullptr, nullptr, name, &given, nullptr));
  if (given < low) throw InputError(fmt::format("option {} is {}; it is at least {}", name, given, low));
  value = given;
}

}  // namespace

LinearSolverOptions linear_options(LinearChoice choice) {
  LinearSolverOptions options;
  switch (choice) {
    case LinearChoice::gmres_ilu:
      options.method = LinearMethod::gmres_ilu;
      break;
    case LinearChoice::conjugate_residual:
      options.method = LinearMethod::conjugate_residual;
      break;
    case LinearChoice::block_triangular:
      options.method = LinearMethod::block_triangular;
      break;
  }
  return options;
}

void read_database(LinearSolverOptions& options) {
  constexpr std::array methods = {"block_triangular", "gamg", "gmres_ilu", "conjugate_residual", "direct"};
  constexpr std::array modes = {"automatic", "translations", "rigid"};
  constexpr std::array precisions = {"automatic", "single", "double"};
  read_choice("-malleus_method", methods, options.method);
  read_choice("-malleus_modes", modes, options.preconditioner.modes);
  read_choice("-malleus_precision", precisions, options.preconditioner.precision);
  constexpr std::array matrices = {"assembled", "free"};
  int matrix = options.matrix_free ? 1 : 0;
  read_choice("-malleus_matrix", matrices, matrix);
  options.matrix_free = matrix == 1;
  read_integer("-malleus_chebyshev_steps", 1, options.preconditioner.chebyshev_steps);
  read_integer("-malleus_restart", 0, options.restart);
  PetscReal threshold = options.preconditioner.threshold;
  petsc_call(PetscOptionsGetReal(nullptr, nullptr, "-malleus_threshold", &threshold, nullptr));
  if (!(threshold >= 0 && threshold < 1)) {
    throw InputError(fmt::format("option -malleus_threshold is {}; it lies in [0, 1)", threshold));
  }
  options.preconditioner.threshold = threshold;
}

}  // namespace malleus
