#pragma once

/// The distributed block matrix, filled block by block without a search in PETSc's stash.

#include <petscmat.h>

#include <map>
#include <vector>

#include "fem/node_space.hpp"

namespace malleus {

/// A square matrix of blocks (dim+1 a node), pattern from the elements of the mesh and extra couplings, exactly
/// preallocated: MATSEQBAIJ on one rank, MATMPIBAIJ on several; rows = global node numbers. Blocks are added to any row
/// whose node the rank holds; finish() sends those of other ranks' rows to them, in rank order, so that sums repeat
/// bit for bit.
class SystemMatrix {
 public:
  /// tuples: couplings of which this rank will add blocks; all their nodes are in `space`. Collective.
  SystemMatrix(const Communicator& comm, const NodeSpace& space, const NodeTuples& tuples);
  SystemMatrix(const SystemMatrix&) = delete;
  SystemMatrix& operator=(const SystemMatrix&) = delete;
  ~SystemMatrix();

  /// Opens the matrix for adding, with all entries zero. Local.
  void start();
  /// Adds a block [dim+1][dim+1], by columns, at nodes in the numbering of the space. Local; between start and finish.
  void add(LocalId row, LocalId column, const Real* block);
  /// Sums the parts of all ranks; then entries on the diagonal that are zero become `diagonal` for velocities and
  /// -`diagonal` for pressures (nodes that are not modelled). Collective.
  void finish(Real diagonal);

  Mat matrix() const noexcept { return matrix_; }

 private:
  /// Rows of nodes that other ranks own, in compressed rows of local nodes.
  struct GuestRows {
    std::vector<std::size_t> offsets = {0};
    std::vector<LocalId> columns;
    std::vector<Real> values;
    std::map<int, std::vector<std::size_t>> blocks_of;  ///< owner -> its blocks, in the order in which they are sent
  };
  /// One of PETSc's two sequential parts: columns of owned nodes, columns of others.
  struct Part {
    Mat matrix = nullptr;
    const PetscInt* offsets = nullptr;
    const PetscInt* columns = nullptr;
    Real* values = nullptr;
  };

  void create(const std::vector<PetscInt>& offsets, const std::vector<PetscInt>& columns);
  void map_columns(const NodeSpace& space);
  std::size_t locate(LocalId row, GlobalId column) const;
  Real* find(LocalId row, LocalId column);
  void add_guest_blocks();
  void fill_empty_diagonals(Real diagonal);

  const Communicator* comm_;
  GlobalId first_row_;
  int block_size_;
  LocalId owned_;
  Mat matrix_ = nullptr;
  Part inside_;
  Part outside_;
  const PetscInt* outside_numbers_ = nullptr;  ///< column of the outside part -> global node
  PetscInt outside_count_ = 0;
  std::vector<PetscInt> outside_columns_;  ///< local node - owned -> column of the outside part, -1 = none
  GuestRows guests_;
  /// rank -> where the blocks that it sends go: block of the inside part, or past its end of the outside part
  std::map<int, std::vector<std::size_t>> hosted_;
};

}  // namespace malleus
