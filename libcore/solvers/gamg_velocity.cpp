#include "solvers/gamg_velocity.hpp"

#include <algorithm>

#include "base/floating_point.hpp"
#include "base/index.hpp"
#include "solvers/petsc_objects.hpp"

namespace malleus {
namespace {

/// The velocity block as an AIJ matrix with its block size.
PetscMatrix make_matrix(const Communicator& comm, const MultigridLevel& level) {
  const int dim = level.values.rows;
  const PetscInt local = level.graph.rows() * dim;
  std::vector<PetscInt> owned(index(level.graph.rows()));
  std::vector<PetscInt> foreign(owned.size());
  for (LocalId row = 0; row < level.graph.rows(); ++row) {
    for (LocalId k = level.graph.offsets[index(row)]; k < level.graph.offsets[index(row) + 1]; ++k) {
      ++(level.graph.columns[index(k)] < level.graph.rows() ? owned : foreign)[index(row)];
    }
  }
  PetscMatrix matrix;
  petsc_call(MatCreate(comm.raw(), matrix.out()));
  petsc_call(MatSetSizes(matrix.get(), local, local, PETSC_DETERMINE, PETSC_DETERMINE));
  petsc_call(MatSetBlockSize(matrix.get(), dim));
  petsc_call(MatSetType(matrix.get(), MATAIJ));
  petsc_call(MatXAIJSetPreallocation(matrix.get(), dim, owned.data(), foreign.data(), nullptr, nullptr));
  petsc_call(MatSetOption(matrix.get(), MAT_ROW_ORIENTED, PETSC_FALSE));
  for (LocalId row = 0; row < level.graph.rows(); ++row) {
    const auto number = static_cast<PetscInt>(level.layout.global(row));
    for (LocalId k = level.graph.offsets[index(row)]; k < level.graph.offsets[index(row) + 1]; ++k) {
      const auto column = static_cast<PetscInt>(level.layout.global(level.graph.columns[index(k)]));
      petsc_call(MatSetValuesBlocked(matrix.get(), 1, &number, 1, &column, level.values.at(k), INSERT_VALUES));
    }
  }
  petsc_call(MatAssemblyBegin(matrix.get(), MAT_FINAL_ASSEMBLY));
  petsc_call(MatAssemblyEnd(matrix.get(), MAT_FINAL_ASSEMBLY));
  return matrix;
}

/// Rigid-body modes, without their parts along fixed directions.
void attach_rigid_modes(const Communicator& comm, const MultigridLevel& level, const NodeConstraints& constraints,
                        Mat matrix) {
  const int dim = level.values.rows;
  PetscVector points;
  petsc_call(VecCreateMPI(comm.raw(), level.graph.rows() * dim, PETSC_DETERMINE, points.out()));
  petsc_call(VecSetBlockSize(points.get(), dim));
  PetscScalar* values = nullptr;
  petsc_call(VecGetArrayWrite(points.get(), &values));
  std::copy(level.points.begin(), level.points.end(), values);
  petsc_call(VecRestoreArrayWrite(points.get(), &values));
  PetscNullSpace free_modes;
  petsc_call(MatNullSpaceCreateRigidBody(points.get(), free_modes.out()));
  PetscInt count = 0;
  const Vec* modes = nullptr;
  petsc_call(MatNullSpaceGetVecs(free_modes.get(), nullptr, &count, &modes));
  for (PetscInt m = 0; m < count; ++m) {
    petsc_call(VecGetArray(modes[m], &values));
    for (LocalId node = 0; node < level.graph.rows(); ++node)
      constraints.project(node, values + index(node) * index(dim));
    petsc_call(VecRestoreArray(modes[m], &values));
  }
  petsc_call(MatSetNearNullSpace(matrix, free_modes.get()));
}

class GamgVelocity final : public VelocityMultigrid {
 public:
  GamgVelocity(const Communicator& comm, const MultigridLevel& level, const NodeConstraints& constraints,
               bool rigid_modes)
      : matrix_(make_matrix(comm, level)) {
    if (rigid_modes) attach_rigid_modes(comm, level, constraints, matrix_.get());
    petsc_call(MatCreateVecs(matrix_.get(), in_.out(), out_.out()));
    petsc_call(PCCreate(comm.raw(), cycle_.out()));
    petsc_call(PCSetOptionsPrefix(cycle_.get(), "velocity_"));
    petsc_call(PCSetOperators(cycle_.get(), matrix_.get(), matrix_.get()));
    petsc_call(PCSetType(cycle_.get(), PCGAMG));
    const PetscReal threshold = 0.01;
    petsc_call(PCGAMGSetThreshold(cycle_.get(), const_cast<PetscReal*>(&threshold), 1));
    petsc_call(PCSetFromOptions(cycle_.get()));
    const TrapsOff traps_off;
    petsc_call(PCSetUp(cycle_.get()));
    PetscBool is_gamg = PETSC_FALSE;
    petsc_call(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(cycle_.get()), PCGAMG, &is_gamg));
    PetscInt count = 1;
    PetscReal grid = 1;
    if (is_gamg == PETSC_TRUE) {
      petsc_call(PCMGGetLevels(cycle_.get(), &count));
      petsc_call(PCMGGetGridComplexity(cycle_.get(), &grid, &complexity_));
    }
    summary_.resize(static_cast<std::size_t>(count));
    if (!summary_.empty()) summary_.front() = {level.layout.ownership.total(), level.values.rows, 0, comm.size()};
  }

  void apply(const Real* residual, Real* correction) override {
    const TrapsOff traps_off;
    petsc_call(VecPlaceArray(in_.get(), residual));
    petsc_call(VecPlaceArray(out_.get(), correction));
    petsc_call(PCApply(cycle_.get(), in_.get(), out_.get()));
    petsc_call(VecResetArray(in_.get()));
    petsc_call(VecResetArray(out_.get()));
  }
  const std::vector<MultigridLevelSummary>& levels() const override { return summary_; }
  Real operator_complexity() const override { return complexity_; }
  std::size_t bytes() const override { return 0; }

 private:
  PetscMatrix matrix_;
  PetscVector in_, out_;
  PetscPreconditioner cycle_;
  PetscReal complexity_ = 1;
  std::vector<MultigridLevelSummary> summary_;
};

}  // namespace

std::unique_ptr<VelocityMultigrid> make_gamg_velocity(const Communicator& comm, const MultigridLevel& level,
                                                      const NodeConstraints& constraints, bool rigid_modes) {
  return std::make_unique<GamgVelocity>(comm, level, constraints, rigid_modes);
}

}  // namespace malleus
