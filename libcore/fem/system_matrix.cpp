#include "fem/system_matrix.hpp"

#include <algorithm>
#include <limits>

#include "base/error.hpp"
#include "base/short_row.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {

namespace {

/// Couplings of local nodes in compressed rows, each row increasing and with its own node.
struct NodeGraph {
  std::vector<std::size_t> offsets = {0};
  std::vector<LocalId> columns;

  std::span<const LocalId> row(LocalId node) const {
    const auto i = static_cast<std::size_t>(node);
    return std::span(columns).subspan(offsets[i], offsets[i + 1] - offsets[i]);
  }
};

/// Node sets that couple: elements and tuples, one after the other, in local numbers.
struct NodeSets {
  std::vector<LocalId> nodes;
  std::vector<std::size_t> offsets = {0};
};

NodeSets coupled_sets(const NodeSpace& space, const NodeTuples& tuples) {
  NodeSets sets;
  const auto corners = static_cast<std::size_t>(space.mesh().dim) + 1;
  sets.nodes = space.mesh().element_nodes;
  for (std::size_t end = corners; end <= sets.nodes.size(); end += corners) sets.offsets.push_back(end);
  for (std::size_t i = 0; i < tuples.size(); ++i) {
    for (const GlobalId number : tuples[i]) {
      const LocalId node = space.local_node(number);
      check(node >= 0, "the nodes of a coupling are in the node space");
      sets.nodes.push_back(node);
    }
    sets.offsets.push_back(sets.nodes.size());
  }
  return sets;
}

NodeGraph node_graph(LocalId nodes, const NodeSets& sets) {
  // node -> sets, by counting
  std::vector<std::size_t> starts(static_cast<std::size_t>(nodes) + 1, 0);
  for (const LocalId node : sets.nodes) ++starts[static_cast<std::size_t>(node) + 1];
  for (std::size_t i = 1; i < starts.size(); ++i) starts[i] += starts[i - 1];
  std::vector<std::size_t> sets_of(sets.nodes.size());
  std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
  for (std::size_t s = 0; s + 1 < sets.offsets.size(); ++s) {
    for (std::size_t k = sets.offsets[s]; k < sets.offsets[s + 1]; ++k) {
      sets_of[next[static_cast<std::size_t>(sets.nodes[k])]++] = s;
    }
  }
  NodeGraph graph;
  graph.offsets.reserve(static_cast<std::size_t>(nodes) + 1);
  std::vector<LocalId> row;
  for (LocalId node = 0; node < nodes; ++node) {
    row.assign(1, node);
    for (std::size_t k = starts[static_cast<std::size_t>(node)]; k < starts[static_cast<std::size_t>(node) + 1]; ++k) {
      const std::size_t s = sets_of[k];
      row.insert(row.end(), sets.nodes.begin() + static_cast<std::ptrdiff_t>(sets.offsets[s]),
                 sets.nodes.begin() + static_cast<std::ptrdiff_t>(sets.offsets[s + 1]));
    }
    std::sort(row.begin(), row.end());
    graph.columns.insert(graph.columns.end(), row.begin(), std::unique(row.begin(), row.end()));
    graph.offsets.push_back(graph.columns.size());
  }
  return graph;
}

/// A block of the matrix by global node numbers.
struct BlockPlace {
  GlobalId row;
  GlobalId column;
  auto operator<=>(const BlockPlace&) const = default;
};

using Places = std::map<int, std::vector<BlockPlace>>;

/// Compressed rows of the owned nodes in global numbers: local couplings and those that other ranks reported.
void owned_rows(const NodeSpace& space, const NodeGraph& graph, const Places& reported, std::vector<PetscInt>& offsets,
                std::vector<PetscInt>& columns) {
  const GlobalId first = space.mesh().node_ownership.begin();
  std::vector<BlockPlace> more;
  for (const auto& [rank, places] : reported) more.insert(more.end(), places.begin(), places.end());
  std::sort(more.begin(), more.end());
  offsets.assign(1, 0);
  auto next = more.begin();
  std::vector<PetscInt> row;
  for (LocalId node = 0; node < space.owned(); ++node) {
    row.clear();
    for (const LocalId column : graph.row(node)) row.push_back(static_cast<PetscInt>(space.global_node(column)));
    for (; next != more.end() && next->row == first + node; ++next) row.push_back(static_cast<PetscInt>(next->column));
    std::sort(row.begin(), row.end());
    columns.insert(columns.end(), row.begin(), std::unique(row.begin(), row.end()));
    offsets.push_back(static_cast<PetscInt>(columns.size()));
  }
  check(next == more.end(), "couplings are reported to the owner of their row");
}

/// The arrays are the matrix's own, valid as long as it. They are not given back: PETSc 3.18 would free them.
void read_structure(Mat matrix, const PetscInt*& offsets, const PetscInt*& columns) {
  PetscInt rows = 0;
  PetscBool done = PETSC_FALSE;
  MatGetRowIJ(matrix, 0, PETSC_FALSE, PETSC_TRUE, &rows, &offsets, &columns, &done);
  check(done == PETSC_TRUE, "PETSc gives the structure of a block matrix");
}

}  // namespace

SystemMatrix::SystemMatrix(const Communicator& comm, const NodeSpace& space, const NodeTuples& tuples)
    : comm_(&comm),
      first_row_(space.mesh().node_ownership.begin()),
      block_size_(space.mesh().dim + 1),
      owned_(space.owned()) {
  check(space.mesh().total_nodes() * block_size_ < std::numeric_limits<PetscInt>::max(),
        "the unknowns are counted by PETSc's integers");
  const NodeGraph graph = node_graph(space.nodes(), coupled_sets(space, tuples));
  Places guests;
  for (LocalId node = owned_; node < space.nodes(); ++node) {
    const GlobalId number = space.global_node(node);
    const int owner = space.mesh().node_ownership.owner_of(number);
    for (const LocalId column : graph.row(node)) {
      guests[owner].push_back({number, space.global_node(column)});
      guests_.blocks_of[owner].push_back(guests_.columns.size());
      guests_.columns.push_back(column);
    }
    guests_.offsets.push_back(guests_.columns.size());
  }
  const Places reported = sparse_exchange(comm, guests);
  std::vector<PetscInt> offsets;
  std::vector<PetscInt> columns;
  owned_rows(space, graph, reported, offsets, columns);
  create(offsets, columns);
  map_columns(space);
  for (const auto& [rank, places] : reported) {
    for (const auto& [row, column] : places) {
      hosted_[rank].push_back(locate(static_cast<LocalId>(row - first_row_), column));
    }
  }
}

SystemMatrix::~SystemMatrix() {
  MatDestroy(&matrix_);
}

void SystemMatrix::create(const std::vector<PetscInt>& offsets, const std::vector<PetscInt>& columns) {
  MatCreate(comm_->raw(), &matrix_);
  const PetscInt rows = owned_ * block_size_;
  MatSetSizes(matrix_, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE);
  MatSetType(matrix_, comm_->size() == 1 ? MATSEQBAIJ : MATMPIBAIJ);
  MatSetBlockSize(matrix_, block_size_);
  if (comm_->size() == 1) {
    MatSeqBAIJSetPreallocationCSR(matrix_, block_size_, offsets.data(), columns.data(), nullptr);
    inside_.matrix = matrix_;
  } else {
    MatMPIBAIJSetPreallocationCSR(matrix_, block_size_, offsets.data(), columns.data(), nullptr);
    MatMPIBAIJGetSeqBAIJ(matrix_, &inside_.matrix, &outside_.matrix, &outside_numbers_);
    PetscInt width = 0;
    MatGetSize(outside_.matrix, nullptr, &width);
    outside_count_ = width / block_size_;
    read_structure(outside_.matrix, outside_.offsets, outside_.columns);
  }
  read_structure(inside_.matrix, inside_.offsets, inside_.columns);
}

void SystemMatrix::map_columns(const NodeSpace& space) {
  for (LocalId node = owned_; node < space.nodes(); ++node) {
    const auto number = static_cast<PetscInt>(space.global_node(node));
    const PetscInt* end = outside_numbers_ + outside_count_;
    const PetscInt* place = std::lower_bound(outside_numbers_, end, number);
    const bool found = place != end && *place == number;
    outside_columns_.push_back(found ? static_cast<PetscInt>(place - outside_numbers_) : -1);
  }
}

std::size_t SystemMatrix::locate(LocalId row, GlobalId column) const {
  const bool inside = column >= first_row_ && column < first_row_ + owned_;
  const Part& part = inside ? inside_ : outside_;
  PetscInt wanted = static_cast<PetscInt>(column - first_row_);
  if (!inside) {
    const PetscInt* end = outside_numbers_ + outside_count_;
    wanted = static_cast<PetscInt>(std::lower_bound(outside_numbers_, end, static_cast<PetscInt>(column)) -
                                   outside_numbers_);
  }
  const PetscInt* end = part.columns + part.offsets[row + 1];
  const PetscInt* place = std::lower_bound(part.columns + part.offsets[row], end, wanted);
  check(place != end && *place == wanted, "a block is in the pattern");
  const auto block = static_cast<std::size_t>(place - part.columns);
  return inside ? block : static_cast<std::size_t>(inside_.offsets[owned_]) + block;
}

Real* SystemMatrix::find(LocalId row, LocalId column) {
  const auto entries = static_cast<std::size_t>(block_size_) * static_cast<std::size_t>(block_size_);
  if (row >= owned_) {
    const auto i = static_cast<std::size_t>(row - owned_);
    const LocalId* begin = guests_.columns.data() + guests_.offsets[i];
    const LocalId* end = guests_.columns.data() + guests_.offsets[i + 1];
    const LocalId* place = begin + place_in_row(begin, end - begin, column);
    check(place != end && *place == column, "a block is in the pattern");
    return guests_.values.data() + static_cast<std::size_t>(place - guests_.columns.data()) * entries;
  }
  const bool inside = column < owned_;
  const Part& part = inside ? inside_ : outside_;
  const PetscInt wanted = inside ? column : outside_columns_[static_cast<std::size_t>(column - owned_)];
  const PetscInt* begin = part.columns + part.offsets[row];
  const PetscInt* end = part.columns + part.offsets[row + 1];
  const PetscInt* place = begin + place_in_row(begin, end - begin, wanted);
  check(place != end && *place == wanted, "a block is in the pattern");
  return part.values + static_cast<std::size_t>(place - part.columns) * entries;
}

void SystemMatrix::start() {
  MatZeroEntries(matrix_);  // also tells PETSc that the entries change
  MatSeqBAIJGetArray(inside_.matrix, &inside_.values);
  if (outside_.matrix != nullptr) MatSeqBAIJGetArray(outside_.matrix, &outside_.values);
  const auto entries = static_cast<std::size_t>(block_size_) * static_cast<std::size_t>(block_size_);
  guests_.values.assign(guests_.columns.size() * entries, 0.0);
}

void SystemMatrix::add(LocalId row, LocalId column, const Real* block) {
  Real* place = find(row, column);
  const int entries = block_size_ * block_size_;
  for (int k = 0; k < entries; ++k) place[k] += block[k];
}

void SystemMatrix::add_guest_blocks() {
  const auto entries = static_cast<std::size_t>(block_size_) * static_cast<std::size_t>(block_size_);
  std::map<int, std::vector<Real>> outgoing;
  for (const auto& [rank, blocks] : guests_.blocks_of) {
    std::vector<Real>& values = outgoing[rank];
    values.reserve(blocks.size() * entries);
    for (const std::size_t block : blocks) {
      const Real* first = guests_.values.data() + block * entries;
      values.insert(values.end(), first, first + entries);
    }
  }
  const auto inside_blocks = static_cast<std::size_t>(inside_.offsets[owned_]);
  for (const auto& [rank, values] : sparse_exchange(*comm_, outgoing)) {
    const Real* source = values.data();
    for (const std::size_t block : hosted_.at(rank)) {
      Real* place = block < inside_blocks ? inside_.values + block * entries
                                          : outside_.values + (block - inside_blocks) * entries;
      for (std::size_t k = 0; k < entries; ++k) place[k] += source[k];
      source += entries;
    }
  }
}

void SystemMatrix::fill_empty_diagonals(Real diagonal) {
  for (LocalId row = 0; row < owned_; ++row) {
    Real* block = find(row, row);
    for (int i = 0; i < block_size_; ++i) {
      Real& entry = block[i * (block_size_ + 1)];
      if (entry == 0) entry = i + 1 < block_size_ ? diagonal : -diagonal;
    }
  }
}

void SystemMatrix::finish(Real diagonal) {
  add_guest_blocks();
  fill_empty_diagonals(diagonal);
  guests_.values.clear();
  guests_.values.shrink_to_fit();
  MatSeqBAIJRestoreArray(inside_.matrix, &inside_.values);
  if (outside_.matrix != nullptr) MatSeqBAIJRestoreArray(outside_.matrix, &outside_.values);
  MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY);
  MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY);
}

}  // namespace malleus
