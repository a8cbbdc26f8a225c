#include "solvers/multigrid/coarse_space.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/index.hpp"
#include "base/short_row.hpp"

namespace malleus {
namespace {

template <int Rows, int Columns = Rows>
using Block = Eigen::Matrix<Real, Rows, Columns>;
template <int Rows, int Columns = Rows>
using BlockView = Eigen::Map<Block<Rows, Columns>>;
template <int Rows, int Columns = Rows>
using ConstBlockView = Eigen::Map<const Block<Rows, Columns>>;

/// Leaves out the directions that have next to no stiffness.
template <int B>
Block<B> pseudo_inverse(const Block<B>& block) {
  if constexpr (B <= 3) {
    // Where the determinant, of the block scaled to a trace of B, shows that none is left out. Eigenvalues cost more
    // than all sweeps of a cycle.
    const Real mean = block.trace() / B;
    constexpr Real plain = 1e-4;
    const Block<B> scaled = block / (mean > 0 ? mean : 1);
    if (mean > 0 && scaled.determinant() > plain) return scaled.inverse() / mean;
  }
  const Eigen::SelfAdjointEigenSolver<Block<B>> solver(block);
  Eigen::Matrix<Real, B, 1> values = solver.eigenvalues();
  const Real least = 1e-9 * values[B - 1];
  for (Real& value : values) value = value > least ? 1 / value : 0;
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

template <int B>
void invert_diagonals_of(MultigridLevel& level) {
  level.inverses.assign(index(level.graph.rows()) * B * B + BlockValues<Real>::padding, 0.0);
  for (LocalId row = 0; row < level.graph.rows(); ++row) {
    const Block<B> diagonal = ConstBlockView<B>(level.values.at(level.graph.diagonals[index(row)]));
    BlockView<B> inverse(level.inverses.data() + index(row) * B * B);
    inverse = pseudo_inverse<B>(diagonal);  // nodes that move along a gate's normal alone make a singular coarse block
  }
}

/// y = D^-1 A x on the owned rows; returns |y|^2 of this rank.
template <int B>
Real apply_scaled(const MultigridLevel& level, const std::vector<Real>& x, std::vector<Real>& y) {
  Real square = 0;
  for (LocalId row = 0; row < level.graph.rows(); ++row) {
    Eigen::Matrix<Real, B, 1> sum = Eigen::Matrix<Real, B, 1>::Zero();
    for (LocalId k = level.graph.offsets[index(row)]; k < level.graph.offsets[index(row) + 1]; ++k) {
      const Real* source = x.data() + index(level.graph.columns[index(k)]) * B;
      sum += ConstBlockView<B>(level.values.at(k)) * Eigen::Map<const Eigen::Matrix<Real, B, 1>>(source);
    }
    const Eigen::Matrix<Real, B, 1> scaled = ConstBlockView<B>(level.inverses.data() + index(row) * B * B) * sum;
    Eigen::Map<Eigen::Matrix<Real, B, 1>>(y.data() + index(row) * B) = scaled;
    square += scaled.squaredNorm();
  }
  return square;
}

/// The modes of a coarse node at `offset` = (x - x_coarse) / scale from it, a column each.
void fill_modes(int dim, const Real* offset, bool rigid, Eigen::Ref<Eigen::MatrixXd> modes) {
  modes.setZero();
  for (int d = 0; d < dim; ++d) modes(d, d) = 1;
  if (!rigid) return;
  if (dim == 2) {
    modes(0, 2) = -offset[1];
    modes(1, 2) = offset[0];
    return;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    const int last = (axis + 2) % 3;
    modes(last, 3 + axis) = offset[next];
    modes(next, 3 + axis) = -offset[last];
  }
}

class CoarseSpaceBuilder {
 public:
  CoarseSpaceBuilder(const Communicator& comm, const MultigridLevel& level, const Aggregates& aggregates,
                     const Ownership& coarse, AggregateModes modes, const NodeConstraints* constraints)
      : comm_(comm),
        level_(level),
        aggregates_(aggregates),
        coarse_(coarse),
        dim_(modes.dim),
        rigid_(modes.rigid),
        constraints_(constraints),
        modes_(coarse_modes(modes.dim, modes.rigid)),
        first_(comm.sum_of_lower_ranks(static_cast<GlobalId>(aggregates.count))) {}

  CoarseSpace run() {
    place_aggregates();
    make_tentative();
    with_blocks(level_.values.rows, modes_, [&](auto rows, auto columns) { smooth<rows, columns>(); });
    move_points();
    result_.scale = scale_;
    return std::move(result_);
  }

 private:
  LocalId aggregate_of(LocalId node) const { return aggregates_.of_node[index(node)]; }

  /// Centroids of the aggregates of this rank, and the root mean square distance of nodes from theirs over all ranks.
  void place_aggregates() {
    const auto dim = index(dim_);
    centroids_.assign(index(aggregates_.count) * dim, 0.0);
    std::vector<Real> sizes(index(aggregates_.count), 0.0);
    for (LocalId node = 0; node < level_.graph.rows(); ++node) {
      if (aggregate_of(node) < 0) continue;
      sizes[index(aggregate_of(node))] += 1;
      for (std::size_t d = 0; d < dim; ++d) centroid(node)[d] += level_.points[index(node) * dim + d];
    }
    for (std::size_t a = 0; a < sizes.size(); ++a) {
      for (std::size_t d = 0; d < dim; ++d) centroids_[a * dim + d] /= sizes[a];
    }
    std::array<Real, 2> sums = {0, 0};
    for (LocalId node = 0; node < level_.graph.rows(); ++node) {
      if (aggregate_of(node) < 0) continue;
      sums[1] += 1;
      for (std::size_t d = 0; d < dim; ++d) {
        const Real offset = level_.points[index(node) * dim + d] - centroid(node)[d];
        sums[0] += offset * offset;
      }
    }
    comm_.sum_in_place(std::span(sums));
    scale_ = sums[0] > 0 ? std::sqrt(sums[0] / sums[1]) : 1.0;
  }

  Real* centroid(LocalId node) { return centroids_.data() + index(aggregate_of(node)) * index(dim_); }
  const Real* centroid(LocalId node) const { return centroids_.data() + index(aggregate_of(node)) * index(dim_); }

  /// The modes of the aggregate of `member` (owned) at `node` (owned or copy).
  void fill_modes_at(LocalId node, LocalId member, Eigen::Ref<Eigen::MatrixXd> modes) const {
    std::array<Real, 3> offset{};
    for (int d = 0; d < dim_; ++d) {
      offset[index(d)] = (points_[index(node) * index(dim_) + index(d)] - centroid(member)[d]) / scale_;
    }
    fill_modes(dim_, offset.data(), rigid_, modes);
    for (Eigen::Index r = dim_; r < modes.rows(); ++r) modes(r, r) = level_.scale / scale_;
    if (projectors_.empty()) return;
    const Eigen::Map<const Eigen::MatrixXd> projector(projectors_.data() + index(node) * index(dim_ * dim_), dim_,
                                                      dim_);
    modes = (projector * modes).eval();
  }

  /// Of the constraints, for owned nodes and copies. The copies are not the mesh's: contact couples more.
  void find_projectors() {
    if (constraints_ == nullptr) return;
    const auto size = index(dim_ * dim_);
    projectors_.assign(index(level_.layout.size()) * size, 0.0);
    for (LocalId node = 0; node < level_.graph.rows(); ++node) {
      for (int d = 0; d < dim_; ++d) {
        Real* column = projectors_.data() + index(node) * size + index(d * dim_);
        column[d] = 1;
        constraints_->project(node, column);
      }
    }
    level_.layout.halo.update_copies(std::span(projectors_), dim_ * dim_);
  }

  /// The modes at each node, and the global number of its aggregate, for owned nodes and copies.
  void make_tentative() {
    points_ = level_.points;
    points_.resize(index(level_.layout.size()) * index(dim_));
    level_.layout.halo.update_copies(std::span(points_), dim_);
    find_projectors();
    const int block = level_.values.rows;
    const auto size = index(block) * index(modes_);
    tentative_.assign(index(level_.layout.size()) * size, 0.0);
    number_.assign(index(level_.layout.size()), -1);
    for (LocalId node = 0; node < level_.graph.rows(); ++node) {
      if (aggregate_of(node) < 0) continue;
      number_[index(node)] = first_ + aggregate_of(node);
      Eigen::Map<Eigen::MatrixXd> modes(tentative_.data() + index(node) * size, block, modes_);
      fill_modes_at(node, node, modes);
    }
    level_.layout.halo.update_copies(std::span(tentative_), static_cast<int>(size));
    level_.layout.halo.update_copies(std::span(number_), 1);
    std::vector<GlobalId> foreign;
    std::copy_if(number_.begin(), number_.end(), std::back_inserter(foreign),
                 [&](GlobalId number) { return number >= 0 && !coarse_.owns(number); });
    std::sort(foreign.begin(), foreign.end());
    foreign.erase(std::unique(foreign.begin(), foreign.end()), foreign.end());
    result_.prolongator.layout = BlockLayout(comm_, coarse_, std::move(foreign));
    column_.resize(number_.size());
    std::transform(number_.begin(), number_.end(), column_.begin(), [&](GlobalId number) {
      return number < 0 ? LocalId{-1} : result_.prolongator.layout.local(number);
    });
  }

  /// Columns of a row, increasing.
  void find_columns(LocalId row, std::vector<LocalId>& columns) const {
    columns.clear();
    if (level_.left_out[index(row)]) return;
    for (LocalId k = level_.graph.offsets[index(row)]; k < level_.graph.offsets[index(row) + 1]; ++k) {
      const LocalId column = column_[index(level_.graph.columns[index(k)])];
      if (column >= 0 && aggregates_.strong[index(k)]) columns.push_back(column);
    }
    std::sort(columns.begin(), columns.end());
    columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  }

  template <int B, int C>
  void smooth() {
    BlockGraph& graph = result_.prolongator.graph;
    std::vector<Real> blocks;
    std::vector<LocalId> columns;
    const Real omega = level_.largest_eigenvalue > 0 ? 4.0 / (3.0 * level_.largest_eigenvalue) : 0.0;
    for (LocalId row = 0; row < level_.graph.rows(); ++row) {
      find_columns(row, columns);
      const std::size_t start = blocks.size();
      blocks.resize(start + columns.size() * B * C, 0.0);
      if (!columns.empty()) smooth_row<B, C>(row, columns, omega, blocks.data() + start);
      graph.columns.insert(graph.columns.end(), columns.begin(), columns.end());
      graph.offsets.push_back(graph.entries());
    }
    BlockValues<Real>& values = result_.prolongator.values;
    values.rows = B;
    values.columns = C;
    values.values = std::move(blocks);
    values.values.resize(values.values.size() + BlockValues<Real>::padding, 0.0);
  }

  /// The blocks of one row of (I - omega D^-1 A) P0.
  template <int B, int C>
  void smooth_row(LocalId row, const std::vector<LocalId>& columns, Real omega, Real* blocks) const {
    for (LocalId k = level_.graph.offsets[index(row)]; k < level_.graph.offsets[index(row) + 1]; ++k) {
      const LocalId j = level_.graph.columns[index(k)];
      if (column_[index(j)] < 0) continue;
      const bool is_strong = aggregates_.strong[index(k)];
      const LocalId column = column_[index(is_strong ? j : row)];
      Block<B, C> modes = ConstBlockView<B, C>(tentative_.data() + index(j) * B * C);
      if (!is_strong) fill_modes_at(j, row, modes);
      const auto place = place_in_row(columns.data(), std::ssize(columns), column);
      BlockView<B, C>(blocks + place * B * C).noalias() += ConstBlockView<B>(level_.values.at(k)) * modes;
    }
    const Block<B> scaling = -omega * ConstBlockView<B>(level_.inverses.data() + index(row) * B * B);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      BlockView<B, C> block(blocks + c * B * C);
      block = (scaling * block).eval();
      if (columns[c] == column_[index(row)]) {
        block += ConstBlockView<B, C>(tentative_.data() + index(row) * B * C);
      }
    }
  }

  /// Gives the centroids to the owners of the coarse nodes.
  void move_points() {
    const BlockLayout& layout = result_.prolongator.layout;
    const auto dim = index(dim_);
    std::vector<Real> points(index(layout.size()) * dim, 0.0);
    for (LocalId node = 0; node < level_.graph.rows(); ++node) {
      if (aggregate_of(node) < 0) continue;
      std::copy_n(centroid(node), dim_,
                  points.begin() + static_cast<std::ptrdiff_t>(index(column_[index(node)]) * dim));
    }
    layout.halo.add_to_owners(std::span(points), dim_);
    points.resize(index(layout.owned()) * dim);
    result_.points = std::move(points);
  }

  const Communicator& comm_;
  const MultigridLevel& level_;
  const Aggregates& aggregates_;
  const Ownership& coarse_;
  int dim_;
  bool rigid_;
  const NodeConstraints* constraints_;
  int modes_;
  GlobalId first_;
  Real scale_ = 1;
  std::vector<Real> points_;      ///< [node][dim], copies too
  std::vector<Real> projectors_;  ///< [node][dim][dim], copies too; empty on coarse levels
  std::vector<Real> centroids_;   ///< [aggregate][dim]
  std::vector<Real> tentative_;   ///< [node][modes][block], copies too
  std::vector<GlobalId> number_;  ///< [node] global number of the aggregate, -1 = none
  std::vector<LocalId> column_;   ///< the same in the prolongator's layout
  CoarseSpace result_;
};

}  // namespace

void invert_diagonals(MultigridLevel& level) {
  with_block(level.values.rows, [&](auto block) { invert_diagonals_of<block>(level); });
}

void estimate_largest_eigenvalue(const Communicator& comm, MultigridLevel& level) {
  constexpr int steps = 8;
  const int block = level.values.rows;
  const auto owned = index(level.graph.rows()) * index(block);
  std::vector<Real> x(index(level.layout.size()) * index(block), 0.0);
  std::vector<Real> y = x;
  const auto first = static_cast<Real>(level.layout.ownership.begin()) * block;
  for (std::size_t i = 0; i < owned; ++i) x[i] = std::sin(1.7 * (first + static_cast<Real>(i)) + 0.3);
  Real square = 0;
  for (std::size_t i = 0; i < owned; ++i) square += x[i] * x[i];
  Real norm = std::sqrt(comm.sum(square));
  for (int step = 0; step < steps && norm > 0; ++step) {
    for (std::size_t i = 0; i < owned; ++i) x[i] /= norm;
    level.layout.halo.update_copies(std::span(x), block);
    square = with_block(block, [&](auto b) { return apply_scaled<b>(level, x, y); });
    norm = std::sqrt(comm.sum(square));
    x.swap(y);
  }
  level.largest_eigenvalue = 1.05 * norm;
}

CoarseSpace make_coarse_space(const Communicator& comm, const MultigridLevel& level, const Aggregates& aggregates,
                              const Ownership& coarse, AggregateModes modes, const NodeConstraints* constraints) {
  return CoarseSpaceBuilder(comm, level, aggregates, coarse, modes, constraints).run();
}

}  // namespace malleus
