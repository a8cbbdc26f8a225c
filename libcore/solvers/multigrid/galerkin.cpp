#include "solvers/multigrid/galerkin.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <map>

#include "base/index.hpp"
#include "base/short_row.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

template <int Rows, int Columns>
using BlockView = Eigen::Map<Eigen::Matrix<Real, Rows, Columns>>;
template <int Rows, int Columns>
using ConstBlockView = Eigen::Map<const Eigen::Matrix<Real, Rows, Columns>>;

/// Rows of the prolongator for all nodes of the fine level's layout, columns as global coarse numbers.
struct GatheredRows {
  std::vector<LocalId> offsets = {0};
  std::vector<GlobalId> columns;
  std::vector<Real> blocks;
};

/// Rows of the copies come from their owners, in the order of the halo's lists.
GatheredRows gather_rows(const Communicator& comm, const BlockLayout& nodes, const Prolongator& prolongator) {
  const auto size = prolongator.values.size();
  std::map<int, std::vector<GlobalId>> numbers;
  std::map<int, std::vector<Real>> blocks;
  for (const Halo::Partner& partner : nodes.halo.partners()) {
    std::vector<GlobalId>& to = numbers[partner.rank];
    for (const LocalId row : partner.sends) {
      const LocalId begin = prolongator.graph.offsets[index(row)];
      const LocalId end = prolongator.graph.offsets[index(row) + 1];
      to.push_back(end - begin);
      for (LocalId k = begin; k < end; ++k) {
        to.push_back(prolongator.layout.global(prolongator.graph.columns[index(k)]));
      }
      std::vector<Real>& values = blocks[partner.rank];
      values.insert(values.end(), prolongator.values.at(begin), prolongator.values.at(end));
    }
  }
  const auto received_numbers = sparse_exchange(comm, numbers);
  const auto received_blocks = sparse_exchange(comm, blocks);
  struct Source {
    const GlobalId* columns;
    const Real* blocks;
    LocalId count;
  };
  std::vector<Source> sources(index(nodes.halo.copies()));
  for (const Halo::Partner& partner : nodes.halo.partners()) {
    if (partner.receives.empty()) continue;
    const GlobalId* number = received_numbers.at(partner.rank).data();
    const auto found = received_blocks.find(partner.rank);
    const Real* block = found == received_blocks.end() ? nullptr : found->second.data();
    for (const LocalId copy : partner.receives) {
      const auto count = static_cast<LocalId>(*number);
      sources[index(copy - nodes.owned())] = {number + 1, block, count};
      number += 1 + count;
      block += index(count) * size;
    }
  }
  GatheredRows rows;
  rows.offsets = prolongator.graph.offsets;
  rows.columns.reserve(prolongator.graph.columns.size());
  for (const LocalId column : prolongator.graph.columns) rows.columns.push_back(prolongator.layout.global(column));
  rows.blocks.assign(prolongator.values.values.begin(), prolongator.values.at(prolongator.graph.entries()) -
                                                            prolongator.values.values.data() +
                                                            prolongator.values.values.begin());
  for (const Source& source : sources) {
    rows.columns.insert(rows.columns.end(), source.columns, source.columns + source.count);
    if (source.count > 0) {
      rows.blocks.insert(rows.blocks.end(), source.blocks, source.blocks + index(source.count) * size);
    }
    rows.offsets.push_back(static_cast<LocalId>(rows.columns.size()));
  }
  return rows;
}

/// P^T A P of this rank's fine rows. Coarse nodes carry workspace numbers: places in `numbers`.
class LocalProduct {
 public:
  LocalProduct(const MultigridLevel& fine, const GatheredRows& p, LocalId fine_rows, const Ownership& coarse)
      : fine_(fine), p_(p) {
    number_columns(coarse);
    marks_.assign(numbers_.size(), -1);
    find_patterns(fine_rows);
  }

  template <int B, int C>
  void compute() {
    values_ = BlockValues<Real>(C, C, graph_.entries());
    std::vector<Real> product;
    for (LocalId row = 0; row + 1 < static_cast<LocalId>(product_offsets_.size()); ++row) {
      const LocalId begin = product_offsets_[index(row)];
      const LocalId end = product_offsets_[index(row) + 1];
      if (p_.offsets[index(row)] == p_.offsets[index(row) + 1]) continue;
      product.assign(index(end - begin) * B * C, 0.0);
      multiply_row<B, C>(row, begin, end, product.data());
      for (LocalId k = p_.offsets[index(row)]; k < p_.offsets[index(row) + 1]; ++k) {
        scatter<B, C>(k, begin, end, product.data());
      }
    }
  }

  const std::vector<GlobalId>& numbers() const { return numbers_; }
  const BlockGraph& graph() const { return graph_; }  ///< rows and columns: workspace numbers
  const BlockValues<Real>& values() const { return values_; }
  /// Where all coarse nodes are this rank's, workspace numbers are theirs: the product is the coarse operator.
  void give_to(MultigridLevel& coarse) {
    coarse.graph = std::move(graph_);
    coarse.values = std::move(values_);
  }

 private:
  /// The workspace: all coarse nodes that this rank owns, and those of others that the rows refer to.
  void number_columns(const Ownership& coarse) {
    std::vector<GlobalId> foreign;
    std::copy_if(p_.columns.begin(), p_.columns.end(), std::back_inserter(foreign),
                 [&](GlobalId number) { return !coarse.owns(number); });
    std::sort(foreign.begin(), foreign.end());
    foreign.erase(std::unique(foreign.begin(), foreign.end()), foreign.end());
    const auto after = std::lower_bound(foreign.begin(), foreign.end(), coarse.begin());
    const GlobalId before = after - foreign.begin();
    numbers_.assign(foreign.begin(), after);
    for (GlobalId number = coarse.begin(); number < coarse.end(); ++number) numbers_.push_back(number);
    numbers_.insert(numbers_.end(), after, foreign.end());
    columns_.reserve(p_.columns.size());
    for (const GlobalId number : p_.columns) {
      const bool is_own = coarse.owns(number);
      const auto place = is_own ? before + number - coarse.begin()
                                : std::lower_bound(numbers_.begin(), numbers_.end(), number) - numbers_.begin();
      columns_.push_back(static_cast<LocalId>(place));
    }
  }

  /// Columns of the rows of A P, then rows of P^T A P as the union of those of the fine rows that refer to them.
  void find_patterns(LocalId fine_rows) {
    std::vector<std::vector<LocalId>> rows_of(numbers_.size());
    for (LocalId row = 0; row < fine_rows; ++row) {
      const bool is_used = p_.offsets[index(row)] < p_.offsets[index(row) + 1];
      for (LocalId k = fine_.graph.offsets[index(row)]; is_used && k < fine_.graph.offsets[index(row) + 1]; ++k) {
        const LocalId j = fine_.graph.columns[index(k)];
        for (LocalId l = p_.offsets[index(j)]; l < p_.offsets[index(j) + 1]; ++l) add_once(columns_[index(l)], row);
      }
      product_offsets_.push_back(static_cast<LocalId>(product_columns_.size()));
      for (LocalId l = p_.offsets[index(row)]; l < p_.offsets[index(row) + 1]; ++l) {
        rows_of[index(columns_[index(l)])].push_back(row);
      }
    }
    std::fill(marks_.begin(), marks_.end(), -1);
    for (LocalId coarse = 0; coarse < static_cast<LocalId>(rows_of.size()); ++coarse) {
      const auto start = static_cast<std::ptrdiff_t>(graph_.columns.size());
      for (const LocalId row : rows_of[index(coarse)]) {
        for (LocalId k = product_offsets_[index(row)]; k < product_offsets_[index(row) + 1]; ++k) {
          const LocalId column = product_columns_[index(k)];
          if (marks_[index(column)] == coarse) continue;
          marks_[index(column)] = coarse;
          graph_.columns.push_back(column);
        }
      }
      std::sort(graph_.columns.begin() + start, graph_.columns.end());
      graph_.offsets.push_back(graph_.entries());
    }
  }

  void add_once(LocalId column, LocalId row) {
    if (marks_[index(column)] == row) return;
    marks_[index(column)] = row;
    product_columns_.push_back(column);
  }

  /// The blocks of a row of A P, in the order of its columns.
  template <int B, int C>
  void multiply_row(LocalId row, LocalId begin, LocalId end, Real* product) {
    for (LocalId k = begin; k < end; ++k) marks_[index(product_columns_[index(k)])] = k - begin;
    for (LocalId k = fine_.graph.offsets[index(row)]; k < fine_.graph.offsets[index(row) + 1]; ++k) {
      const ConstBlockView<B, B> a(fine_.values.at(k));
      const LocalId j = fine_.graph.columns[index(k)];
      for (LocalId l = p_.offsets[index(j)]; l < p_.offsets[index(j) + 1]; ++l) {
        Real* target = product + index(marks_[index(columns_[index(l)])]) * B * C;
        BlockView<B, C>(target).noalias() += a * ConstBlockView<B, C>(p_.blocks.data() + index(l) * B * C);
      }
    }
  }

  /// Adds P_ik^T (A P)_i to the row of coarse node k.
  template <int B, int C>
  void scatter(LocalId entry, LocalId begin, LocalId end, const Real* product) {
    const auto coarse = index(columns_[index(entry)]);
    const ConstBlockView<B, C> p(p_.blocks.data() + index(entry) * B * C);
    const LocalId first = graph_.offsets[coarse];
    const LocalId* row = graph_.columns.data() + first;
    const std::ptrdiff_t count = graph_.offsets[coarse + 1] - first;
    for (LocalId k = begin; k < end; ++k) {
      const std::ptrdiff_t place = place_in_row(row, count, product_columns_[index(k)]);
      Real* target = values_.at(first + static_cast<LocalId>(place));
      BlockView<C, C>(target).noalias() += p.transpose() * ConstBlockView<B, C>(product + index(k - begin) * B * C);
    }
  }

  const MultigridLevel& fine_;
  const GatheredRows& p_;
  std::vector<GlobalId> numbers_;  ///< workspace -> global coarse number, increasing
  std::vector<LocalId> columns_;   ///< columns of p_ in workspace numbers
  std::vector<LocalId> marks_;     ///< [workspace]
  std::vector<LocalId> product_offsets_ = {0};
  std::vector<LocalId> product_columns_;  ///< of A P, in the order in which they are met
  BlockGraph graph_;
  BlockValues<Real> values_;
};

/// Entries of the coarse operator from one rank: row, column (both global) and block.
struct Contributions {
  std::vector<GlobalId> pairs;  ///< [entry][row, column]
  std::vector<Real> blocks;
};

/// Sends the rows of the local product that others own to them. What arrives, in rank order.
std::map<int, Contributions> exchange_rows(const Communicator& comm, const LocalProduct& product,
                                           const Ownership& coarse) {
  std::map<int, std::vector<GlobalId>> pairs;
  std::map<int, std::vector<Real>> blocks;
  for (LocalId row = 0; row < product.graph().rows(); ++row) {
    const LocalId begin = product.graph().offsets[index(row)];
    const LocalId end = product.graph().offsets[index(row) + 1];
    const GlobalId number = product.numbers()[index(row)];
    if (begin == end || coarse.owns(number)) continue;
    const int owner = coarse.owner_of(number);
    for (LocalId k = begin; k < end; ++k) {
      pairs[owner].insert(pairs[owner].end(), {number, product.numbers()[index(product.graph().columns[index(k)])]});
    }
    blocks[owner].insert(blocks[owner].end(), product.values().at(begin), product.values().at(end));
  }
  std::map<int, Contributions> result;
  for (auto& [rank, numbers] : sparse_exchange(comm, pairs)) result[rank].pairs = numbers;
  for (auto& [rank, values] : sparse_exchange(comm, blocks)) result[rank].blocks = values;
  return result;
}

/// Puts the contributions to the rows of this rank together: entries ordered by row and column, those to the same
/// entry summed, the own one first and then by rank.
class RowMerger {
 public:
  RowMerger(const Communicator& comm, const Ownership& ownership, std::size_t block_size)
      : comm_(comm), ownership_(ownership), size_(block_size) {}

  void add(GlobalId row, GlobalId column, const Real* block) {
    entries_.push_back({static_cast<LocalId>(row - ownership_.begin()), -1, column, block});
    if (!ownership_.owns(column)) foreign_.push_back(column);
  }

  void finish(int modes, MultigridLevel& coarse) {
    std::sort(foreign_.begin(), foreign_.end());
    foreign_.erase(std::unique(foreign_.begin(), foreign_.end()), foreign_.end());
    coarse.layout = BlockLayout(comm_, ownership_, std::move(foreign_));
    for (Entry& entry : entries_) entry.column = coarse.layout.local(entry.number);
    std::stable_sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
      return a.row != b.row ? a.row < b.row : a.column < b.column;
    });
    coarse.graph = BlockGraph();
    coarse.values = BlockValues<Real>(modes, modes, 0);
    coarse.values.values.clear();
    coarse.values.values.reserve(entries_.size() * size_ + BlockValues<Real>::padding);
    for (std::size_t k = 0; k < entries_.size(); ++k) {
      const bool is_new =
          k == 0 || entries_[k].row != entries_[k - 1].row || entries_[k].column != entries_[k - 1].column;
      append(entries_[k], is_new, coarse);
    }
    close_rows_before(coarse.layout.owned(), coarse.graph);
    coarse.values.values.resize(coarse.values.values.size() + BlockValues<Real>::padding, 0.0);
    coarse.graph.find_diagonals();
  }

 private:
  struct Entry {
    LocalId row;
    LocalId column;
    GlobalId number;  ///< of the column
    const Real* block;
  };

  static void close_rows_before(LocalId row, BlockGraph& graph) {
    while (graph.rows() < row) graph.offsets.push_back(graph.entries());
  }

  void append(const Entry& entry, bool is_new, MultigridLevel& coarse) const {
    std::vector<Real>& values = coarse.values.values;
    if (is_new) {
      close_rows_before(entry.row, coarse.graph);
      coarse.graph.columns.push_back(entry.column);
      values.insert(values.end(), entry.block, entry.block + size_);
      return;
    }
    Real* sum = values.data() + values.size() - size_;
    for (std::size_t i = 0; i < size_; ++i) sum[i] += entry.block[i];
  }

  const Communicator& comm_;
  const Ownership& ownership_;
  std::size_t size_;
  std::vector<Entry> entries_;
  std::vector<GlobalId> foreign_;
};

}  // namespace

void make_coarse_operator(const Communicator& comm, const MultigridLevel& fine, const Prolongator& prolongator,
                          MultigridLevel& coarse) {
  const GatheredRows p = gather_rows(comm, fine.layout, prolongator);
  const Ownership& ownership = prolongator.layout.ownership;
  LocalProduct product(fine, p, fine.graph.rows(), ownership);
  const int modes = prolongator.values.columns;
  with_blocks(fine.values.rows, modes, [&](auto rows, auto columns) { product.compute<rows, columns>(); });
  if (comm.size() == 1) {
    coarse.layout = BlockLayout(comm, ownership, {});
    product.give_to(coarse);
    coarse.graph.find_diagonals();
    return;
  }
  const std::map<int, Contributions> received = exchange_rows(comm, product, ownership);
  RowMerger merger(comm, ownership, product.values().size());
  for (LocalId row = 0; row < product.graph().rows(); ++row) {
    const GlobalId number = product.numbers()[index(row)];
    if (!ownership.owns(number)) continue;
    for (LocalId k = product.graph().offsets[index(row)]; k < product.graph().offsets[index(row) + 1]; ++k) {
      merger.add(number, product.numbers()[index(product.graph().columns[index(k)])], product.values().at(k));
    }
  }
  for (const auto& [rank, part] : received) {
    for (std::size_t k = 0; 2 * k < part.pairs.size(); ++k) {
      merger.add(part.pairs[2 * k], part.pairs[2 * k + 1], part.blocks.data() + k * product.values().size());
    }
  }
  merger.finish(modes, coarse);
}

}  // namespace malleus
