#include "solvers/multigrid/aggregation.hpp"

#include <algorithm>
#include <cmath>

namespace malleus {
namespace {

constexpr LocalId none = -1;

/// Squared strength of each entry, |A_ij|^2 / (m_i m_j), zero on diagonals; found once, used in each pass.
class Strength {
 public:
  Strength(const BlockLayout& layout, const BlockGraph& graph, const BlockValues<Real>& values, int dim)
      : graph_(graph), squares_(static_cast<std::size_t>(graph.entries())) {
    // In double precision: with viscosities of 1e-8, the products of squares are below what single precision holds.
    std::vector<Real> largest(static_cast<std::size_t>(layout.size()), 0);
    for (LocalId row = 0; row < graph.rows(); ++row) {
      for (LocalId k = begin(row); k < end(row); ++k) {
        if (column(k) != row) largest[index(row)] = std::max(largest[index(row)], norm_squared(values, k, dim));
      }
    }
    layout.halo.update_copies(std::span(largest), 1);
    for (LocalId row = 0; row < graph.rows(); ++row) {
      for (LocalId k = begin(row); k < end(row); ++k) {
        const LocalId j = column(k);
        if (j == row) continue;
        const Real scale = std::sqrt(largest[index(row)]) * std::sqrt(largest[index(j)]);
        if (scale > 0) squares_[index(k)] = static_cast<float>(norm_squared(values, k, dim) / scale);
      }
    }
  }

  LocalId begin(LocalId row) const { return graph_.offsets[index(row)]; }
  LocalId end(LocalId row) const { return graph_.offsets[index(row) + 1]; }
  LocalId column(LocalId entry) const { return graph_.columns[index(entry)]; }
  float square(LocalId entry) const { return squares_[index(entry)]; }

 private:
  static std::size_t index(LocalId i) { return static_cast<std::size_t>(i); }
  static Real norm_squared(const BlockValues<Real>& values, LocalId entry, int dim) {
    const Real* block = values.at(entry);
    Real sum = 0;
    for (int c = 0; c < dim; ++c) {
      for (int r = 0; r < dim; ++r) sum += block[c * values.rows + r] * block[c * values.rows + r];
    }
    return sum;
  }

  const BlockGraph& graph_;
  std::vector<float> squares_;
};

class Aggregator {
 public:
  Aggregator(const BlockGraph& graph, const Strength& strength, Real threshold, const std::vector<bool>& left_out)
      : strength_(strength),
        least_(static_cast<float>(threshold * threshold)),
        left_out_(left_out),
        rows_(graph.rows()),
        of_node_(static_cast<std::size_t>(graph.rows()), none) {}

  Aggregates run() {
    form_whole_neighbourhoods();
    join_strongest_neighbour();
    gather_the_rest();
    return {std::move(of_node_), count_, find_strong()};
  }

 private:
  bool is_above_threshold(LocalId entry) const {
    return strength_.square(entry) >= least_ && strength_.square(entry) > 0;
  }
  /// With a node of this rank: aggregates do not reach beyond.
  bool is_strong(LocalId entry) const {
    const LocalId column = strength_.column(entry);
    return column < rows_ && is_above_threshold(entry) && !is_left_out(column);
  }
  std::vector<bool> find_strong() const {
    std::vector<bool> strong;
    for (LocalId row = 0; row < rows_; ++row) {
      for (LocalId k = strength_.begin(row); k < strength_.end(row); ++k) {
        strong.push_back(strength_.column(k) == row || is_above_threshold(k));
      }
    }
    return strong;
  }
  bool is_left_out(LocalId node) const { return left_out_[static_cast<std::size_t>(node)]; }
  bool is_pending(LocalId node) const { return aggregate_of(node) == none && !is_left_out(node); }
  LocalId aggregate_of(LocalId node) const { return of_node_[static_cast<std::size_t>(node)]; }

  void form(LocalId root) {
    of_node_[static_cast<std::size_t>(root)] = count_;
    for (LocalId k = strength_.begin(root); k < strength_.end(root); ++k) {
      if (is_strong(k) && is_pending(strength_.column(k))) {
        of_node_[static_cast<std::size_t>(strength_.column(k))] = count_;
      }
    }
    ++count_;
  }

  void form_whole_neighbourhoods() {
    for (LocalId node = 0; node < rows_; ++node) {
      if (!is_pending(node)) continue;
      bool is_whole = true;
      int neighbours = 0;
      for (LocalId k = strength_.begin(node); k < strength_.end(node) && is_whole; ++k) {
        if (!is_strong(k)) continue;
        ++neighbours;
        is_whole = aggregate_of(strength_.column(k)) == none;
      }
      if (is_whole && neighbours > 0) form(node);
    }
  }

  void join_strongest_neighbour() {
    const std::vector<LocalId> formed = of_node_;
    for (LocalId node = 0; node < rows_; ++node) {
      if (!is_pending(node)) continue;
      float strongest = 0;
      for (LocalId k = strength_.begin(node); k < strength_.end(node); ++k) {
        const LocalId target = is_strong(k) ? formed[static_cast<std::size_t>(strength_.column(k))] : none;
        if (target == none || strength_.square(k) <= strongest) continue;
        strongest = strength_.square(k);
        of_node_[static_cast<std::size_t>(node)] = target;
      }
    }
  }

  void gather_the_rest() {
    for (LocalId node = 0; node < rows_; ++node) {
      if (is_pending(node)) form(node);
    }
  }

  const Strength& strength_;
  float least_;
  const std::vector<bool>& left_out_;
  LocalId rows_;
  std::vector<LocalId> of_node_;
  LocalId count_ = 0;
};

}  // namespace

Aggregates aggregate(const BlockLayout& layout, const BlockGraph& graph, const BlockValues<Real>& values, int dim,
                     Real threshold, const std::vector<bool>& left_out) {
  const Strength strength(layout, graph, values, dim);
  return Aggregator(graph, strength, threshold, left_out).run();
}

}  // namespace malleus
