#include "solvers/stokes_blocks.hpp"

#include <cmath>
#include <memory>

#include "base/index.hpp"
#include "solvers/petsc_objects.hpp"

namespace malleus {
namespace {

/// Block rows of one sequential part of a BAIJ matrix, for the lifetime of the object.
class SequentialPart {
 public:
  explicit SequentialPart(Mat matrix) : matrix_(matrix) {
    PetscBool done = PETSC_FALSE;
    petsc_call(MatGetRowIJ(matrix, 0, PETSC_FALSE, PETSC_TRUE, &rows_, &offsets_, &columns_, &done));
    check(done == PETSC_TRUE, "a BAIJ matrix shows its block rows");
    petsc_call(MatSeqBAIJGetArray(matrix, &values_));
  }
  SequentialPart(const SequentialPart&) = delete;
  SequentialPart& operator=(const SequentialPart&) = delete;
  ~SequentialPart() {
    PetscBool done = PETSC_FALSE;
    MatSeqBAIJRestoreArray(matrix_, &values_);
    MatRestoreRowIJ(matrix_, 0, PETSC_FALSE, PETSC_TRUE, &rows_, &offsets_, &columns_, &done);
  }

  PetscInt rows() const { return rows_; }
  PetscInt begin(PetscInt row) const { return offsets_[row]; }
  PetscInt end(PetscInt row) const { return offsets_[row + 1]; }
  PetscInt column(PetscInt entry) const { return columns_[entry]; }
  const PetscScalar* block(PetscInt entry, int size) const {
    return values_ + static_cast<std::size_t>(entry) * static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  }

 private:
  Mat matrix_;
  PetscInt rows_ = 0;
  const PetscInt* offsets_ = nullptr;
  const PetscInt* columns_ = nullptr;
  PetscScalar* values_ = nullptr;
};

/// The parts of the matrix with owned and with foreign columns, and the global numbers of the latter.
struct Parts {
  Mat owned = nullptr;
  Mat foreign = nullptr;
  std::vector<GlobalId> copies;
};

Parts find_parts(const LinearSystem& system, Mat matrix) {
  Parts parts;
  PetscBool is_sequential = PETSC_FALSE;
  petsc_call(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(matrix), MATSEQBAIJ, &is_sequential));
  if (is_sequential == PETSC_TRUE) {
    parts.owned = matrix;
    return parts;
  }
  const PetscInt* numbers = nullptr;
  petsc_call(MatMPIBAIJGetSeqBAIJ(matrix, &parts.owned, &parts.foreign, &numbers));
  PetscInt columns = 0;
  petsc_call(MatGetSize(parts.foreign, nullptr, &columns));
  parts.copies.assign(numbers, numbers + columns / system.block_size());
  return parts;
}

/// A power of two near 1 / (largest diagonal entry over all ranks).
Real find_scaling(Mat matrix) {
  PetscVector diagonal;
  petsc_call(MatCreateVecs(matrix, nullptr, diagonal.out()));
  petsc_call(MatGetDiagonal(matrix, diagonal.get()));
  PetscReal largest = 0;
  petsc_call(VecNorm(diagonal.get(), NORM_INFINITY, &largest));
  return largest > 0 ? std::exp2(-std::round(std::log2(largest))) : 1.0;
}

/// Splits the (dim+1)^2 blocks of one part into those of an entry.
template <class T>
class BlockWriter {
 public:
  BlockWriter(StokesBlocks& blocks, BlockValues<T>& velocity, int dim)
      : blocks_(blocks), velocity_(velocity), dim_(dim) {}

  void add(LocalId column, const PetscScalar* block) {
    const auto entry = static_cast<LocalId>(blocks_.graph.columns.size());
    blocks_.graph.columns.push_back(column);
    T* velocity = velocity_.at(entry);
    float* gradient = blocks_.gradient.at(entry);
    const int size = dim_ + 1;
    for (int c = 0; c < dim_; ++c) {
      for (int r = 0; r < dim_; ++r) velocity[c * dim_ + r] = static_cast<T>(blocks_.scaling * block[c * size + r]);
    }
    for (int r = 0; r < dim_; ++r) gradient[r] = static_cast<float>(blocks_.scaling * block[dim_ * size + r]);
    blocks_.pressure[index(entry)] = static_cast<float>(-blocks_.scaling * block[dim_ * size + dim_]);
  }
  void close_row() { blocks_.graph.offsets.push_back(blocks_.graph.entries()); }

 private:
  StokesBlocks& blocks_;
  BlockValues<T>& velocity_;
  int dim_;
};

/// Fills all but the velocity's values, which are returned.
template <class T>
BlockValues<T> read_matrix(const LinearSystem& system, StokesBlocks& blocks) {
  const AssembledMatrix matrix(system);
  blocks.scaling = find_scaling(matrix.get());
  Parts parts = find_parts(system, matrix.get());
  const int dim = system.mesh->dim;
  blocks.layout = BlockLayout(*system.comm, system.mesh->node_ownership, std::move(parts.copies));
  const SequentialPart owned(parts.owned);
  const std::unique_ptr<SequentialPart> foreign =
      parts.foreign == nullptr ? nullptr : std::make_unique<SequentialPart>(parts.foreign);
  const PetscInt rows = owned.rows();
  const PetscInt entries = rows == 0 ? 0 : owned.end(rows - 1) + (foreign ? foreign->end(rows - 1) : 0);
  BlockValues<T> velocity(dim, dim, entries);
  blocks.gradient = BlockValues<float>(dim, 1, entries);
  blocks.pressure.assign(index(entries), 0.0F);
  blocks.graph.columns.reserve(index(entries));
  BlockWriter<T> writer(blocks, velocity, dim);
  for (PetscInt row = 0; row < rows; ++row) {
    for (PetscInt k = owned.begin(row); k < owned.end(row); ++k) {
      writer.add(owned.column(k), owned.block(k, dim + 1));
    }
    for (PetscInt k = foreign ? foreign->begin(row) : 0; foreign && k < foreign->end(row); ++k) {
      writer.add(blocks.layout.owned() + foreign->column(k), foreign->block(k, dim + 1));
    }
    writer.close_row();
  }
  blocks.graph.find_diagonals();
  return velocity;
}

}  // namespace

StokesBlocks extract_blocks(const LinearSystem& system, CyclePrecision precision) {
  StokesBlocks blocks;
  // While entries are made for this alone, both copies of them are the peak of the memory.
  if (system.entries != nullptr && precision == CyclePrecision::single_precision) {
    const BlockValues<float> narrow = read_matrix<float>(system, blocks);
    blocks.velocity.rows = narrow.rows;
    blocks.velocity.columns = narrow.columns;
    blocks.velocity.values.assign(narrow.values.begin(), narrow.values.end());
  } else {
    blocks.velocity = read_matrix<Real>(system, blocks);
  }
  return blocks;
}

}  // namespace malleus
