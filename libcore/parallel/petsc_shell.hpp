#pragma once

/// Functions of our own behind PETSc's shell matrices and preconditioners.

#include <petscpc.h>

#include "base/types.hpp"
#include "parallel/petsc.hpp"

namespace malleus {

/// Calls product(from, to) on the local parts of two vectors. For callbacks of PETSc: returns its error code.
template <class Product>
PetscErrorCode apply_to_arrays(Vec from, Vec to, const Product& product) {
  const PetscScalar* in = nullptr;
  PetscScalar* out = nullptr;
  PetscCall(VecGetArrayRead(from, &in));
  PetscCall(VecGetArray(to, &out));
  product(in, out);
  PetscCall(VecRestoreArray(to, &out));
  PetscCall(VecRestoreArrayRead(from, &in));
  return 0;
}

/// A shell matrix's MATOP_MULT: Context::multiply(x, y) of what the matrix was created with.
template <class Context>
PetscErrorCode multiply_shell(Mat shell, Vec x, Vec y) {
  void* context = nullptr;
  PetscCall(MatShellGetContext(shell, &context));
  return apply_to_arrays(x, y, [&](const Real* from, Real* to) { static_cast<Context*>(context)->multiply(from, to); });
}

/// A shell preconditioner's function: Context::apply(residual, correction).
template <class Context>
PetscErrorCode apply_shell(PC pc, Vec residual, Vec correction) {
  void* context = nullptr;
  PetscCall(PCShellGetContext(pc, &context));
  return apply_to_arrays(residual, correction,
                         [&](const Real* from, Real* to) { static_cast<Context*>(context)->apply(from, to); });
}

/// A square shell matrix of so many rows on this rank whose products context.multiply() makes; the context must outlive
/// it. Collective.
template <class Context>
Mat make_shell_matrix(MPI_Comm comm, PetscInt rows, Context& context) {
  Mat shell = nullptr;
  petsc_call(MatCreateShell(comm, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE, &context, &shell));
  petsc_call(MatShellSetOperation(shell, MATOP_MULT, reinterpret_cast<void (*)()>(multiply_shell<Context>)));
  return shell;
}

}  // namespace malleus
