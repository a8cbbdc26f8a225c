#pragma once

/// Coarser workloads: pairs of vertices become one.

#include <span>
#include <vector>

#include "partition/work_graph.hpp"

namespace malleus {

struct CoarseGraph {
  WorkGraph graph;
  std::vector<LocalId> coarse_of;  ///< [owned vertex of the finer graph] owned vertex of this one
};

/// Merges neighbours of this rank and of one part across their heaviest edges, lighter neighbours first, up to
/// `heaviest` weight. parts: [vertex], copies up to date, or empty where there are none yet. Collective.
CoarseGraph coarsen(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts, Real heaviest);

}  // namespace malleus
