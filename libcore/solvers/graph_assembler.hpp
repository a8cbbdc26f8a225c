#pragma once

/// Sums element contributions into the scalar rows of a block graph.

#include <map>

#include "base/error.hpp"
#include "base/short_row.hpp"
#include "fem/linear_system.hpp"
#include "parallel/sparse_exchange.hpp"
#include "solvers/multigrid/block_rows.hpp"

namespace malleus {

/// A contribution to a row that another rank owns.
struct ForeignEntry {
  GlobalId row;
  GlobalId column;
  Real value;
};

/// Adds to values[entry] of a graph over the nodes of the system's mesh; T is float or double. System, layout, graph
/// and values must outlive it.
template <class T>
class GraphAssembler {
 public:
  GraphAssembler(const LinearSystem& system, const BlockLayout& layout, const BlockGraph& graph, std::vector<T>& values)
      : system_(system), layout_(layout), graph_(graph), values_(values) {}

  /// row, column: local nodes of the mesh that share an element. Local.
  void add(LocalId row, LocalId column, Real value) {
    const Mesh& mesh = *system_.mesh;
    const GlobalId number = mesh.global_node(column);
    if (row < mesh.owned_nodes()) {
      add_here(row, layout_.local(number), value);
    } else {
      const GlobalId row_number = mesh.global_node(row);
      foreign_[mesh.node_ownership.owner_of(row_number)].push_back({row_number, number, value});
    }
  }

  /// Brings what belongs to rows of other ranks there. Collective.
  void finish() {
    for (const auto& [rank, entries] : sparse_exchange(*system_.comm, foreign_)) {
      for (const ForeignEntry& entry : entries) {
        add_here(static_cast<LocalId>(entry.row - layout_.ownership.begin()), layout_.local(entry.column), entry.value);
      }
    }
    foreign_.clear();
  }

 private:
  void add_here(LocalId row, LocalId column, Real value) {
    const LocalId* begin = graph_.columns.data() + graph_.offsets[static_cast<std::size_t>(row)];
    const LocalId* end = graph_.columns.data() + graph_.offsets[static_cast<std::size_t>(row) + 1];
    const LocalId* place = begin + place_in_row(begin, end - begin, column);
    check(place != end && *place == column, "the nodes of an element are coupled in the matrix");
    values_[static_cast<std::size_t>(place - graph_.columns.data())] += static_cast<T>(value);
  }

  const LinearSystem& system_;
  const BlockLayout& layout_;
  const BlockGraph& graph_;
  std::vector<T>& values_;
  std::map<int, std::vector<ForeignEntry>> foreign_;
};

}  // namespace malleus
