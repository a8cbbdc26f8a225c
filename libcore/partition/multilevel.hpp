#pragma once

/// Refinement on ever finer graphs.

#include <vector>

#include "partition/pair_refiner.hpp"

namespace malleus {

struct MultilevelSettings {
  Real tolerance = 0.01;       ///< imbalance aimed at on the given graph; coarser ones have three times as much
  int vertices_per_part = 40;  ///< at which coarsening ends
  int coarse_passes = 4;
  int fine_passes = 2;
};

struct Refined {
  std::vector<int> parts;  ///< [owned vertex]
  std::size_t start = 0;   ///< the one that it was made from
};

/// Improves starts, each a part for each owned vertex, towards targets [part]: neighbours of one part and rank are
/// merged level by level; on the coarsest graph the loads are levelled, and on each level back borders are improved.
/// Coarse vertices make large changes cheap. Of several starts the one that cuts least on its coarsest graph is carried
/// on. What was done is added to count. Collective.
Refined refine_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                          std::vector<std::vector<int>> starts, const std::vector<Real>& targets,
                          const MultilevelSettings& settings, RefinementCount& count);

/// Edges of the graph between parts, divided by the bandwidths of their links; both directions. parts: [owned vertex].
/// Collective.
Real linked_cut(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                std::vector<int> parts);

}  // namespace malleus
