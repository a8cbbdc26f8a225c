#pragma once

/// Refinement of a partition on one rank, all parts at once: what coarse graphs, which every rank holds, are given.

#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

struct KwaySettings {
  Real tolerance = 0.01;  ///< by which loads may exceed their targets; a part above that may only shrink
  int rounds = 3;         ///< over all borders; ends sooner where a round finds nothing
  int patience = 25;      ///< moves without a gain after which a search ends
};

/// Lowers the edges between parts, divided by the bandwidths of their links, by many small searches: each begins at
/// one vertex at a border, moves it to the part where it costs least, goes on with its neighbours even where that costs
/// for a while, and is taken back to its best point. A vertex moves in one search of a round at most, so that a round
/// is work of the order of the borders' length (multi-try k-way search, Sanders and Schulz, 2011). parts: [vertex], is
/// changed; loads, targets: [part] weights, loads are kept up to date. The graph lies on one rank. Returns how many
/// vertices changed part. Local; the same input gives the same parts.
GlobalId refine_kway(const WorkGraph& graph, const Architecture& architecture, std::vector<int>& parts,
                     std::vector<Real>& loads, std::span<const Real> targets, const KwaySettings& settings);

}  // namespace malleus
