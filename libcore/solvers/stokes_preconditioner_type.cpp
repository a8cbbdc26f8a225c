/// The PETSc type "malleus_stokes".

#include <petsc/private/pcimpl.h>

#include "solvers/stokes_preconditioner.hpp"

namespace malleus {
namespace {

PetscErrorCode apply_type(PC pc, Vec residual, Vec correction) {
  auto* preconditioner = static_cast<StokesPreconditioner*>(pc->data);
  PetscCheck(preconditioner != nullptr, PetscObjectComm(reinterpret_cast<PetscObject>(pc)), PETSC_ERR_ORDER,
             "%s is set up by the Stokes solver of the program only", stokes_preconditioner_type);
  const PetscScalar* from = nullptr;
  PetscScalar* to = nullptr;
  PetscCall(VecGetArrayRead(residual, &from));
  PetscCall(VecGetArray(correction, &to));
  preconditioner->apply(from, to);
  PetscCall(VecRestoreArray(correction, &to));
  PetscCall(VecRestoreArrayRead(residual, &from));
  return 0;
}

PetscErrorCode view_type(PC pc, PetscViewer viewer) {
  const auto* preconditioner = static_cast<const StokesPreconditioner*>(pc->data);
  PetscBool is_text = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(viewer), PETSCVIEWERASCII, &is_text));
  if (is_text == PETSC_TRUE && preconditioner != nullptr) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "  %s", preconditioner->table().c_str()));
  }
  return 0;
}

PetscErrorCode destroy_type(PC pc) {
  pc->data = nullptr;
  return 0;
}

PetscErrorCode create_type(PC pc) {
  pc->data = nullptr;
  pc->ops->apply = apply_type;
  pc->ops->view = view_type;
  pc->ops->destroy = destroy_type;
  return 0;
}

}  // namespace

void register_stokes_preconditioner() {
  petsc_call(PCRegister(stokes_preconditioner_type, create_type));
}

void use_stokes_preconditioner(PC pc, StokesPreconditioner& preconditioner) {
  PetscBool is_ours = PETSC_FALSE;
  petsc_call(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), stokes_preconditioner_type, &is_ours));
  if (is_ours == PETSC_TRUE) pc->data = &preconditioner;
}

}  // namespace malleus
