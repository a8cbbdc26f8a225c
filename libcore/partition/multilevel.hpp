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

/// Improves parts [owned vertex] towards targets [part]: neighbours of one part and rank are merged level by level; on
/// the coarsest graph the loads are levelled, and on each level back borders are improved. Coarse vertices make large
/// changes cheap. Returns the parts. Collective.
std::vector<int> refine_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                   std::vector<int> parts, const std::vector<Real>& targets,
                                   const MultilevelSettings& settings);

}  // namespace malleus
