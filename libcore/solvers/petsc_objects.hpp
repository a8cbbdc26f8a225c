#pragma once

/// Names for the PETSc objects that the solvers own.

#include <petscksp.h>

#include "parallel/petsc.hpp"

namespace malleus {

using PetscMatrix = PetscOwner<Mat, MatDestroy>;
using PetscVector = PetscOwner<Vec, VecDestroy>;
using PetscNullSpace = PetscOwner<MatNullSpace, MatNullSpaceDestroy>;
using PetscPreconditioner = PetscOwner<PC, PCDestroy>;
using PetscSolver = PetscOwner<KSP, KSPDestroy>;

}  // namespace malleus
