#pragma once

/// Connected pieces of parts.

#include <span>
#include <vector>

#include "partition/work_graph.hpp"

namespace malleus {

/// For each vertex, copies included, the lowest vertex number of its connected piece: vertices of one part that hang
/// together by edges of the graph, over all ranks. parts: [vertex], copies up to date. Collective.
std::vector<GlobalId> find_pieces(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts);

/// Pieces beyond the first of each part, over all ranks. Collective.
GlobalId count_stray_pieces(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts, int n_parts);

/// Gives each piece but the heaviest of its part to the part that it has most edges to; pieces with no other part
/// around, and those of more than half of `target` (the weight aimed at of each part), stay. Returns how many went.
/// parts: [vertex]; loads: [part], kept up to date. Collective.
GlobalId absorb_stray_pieces(const Communicator& comm, const WorkGraph& graph, std::vector<int>& parts,
                             std::vector<Real>& loads, std::span<const Real> targets);

}  // namespace malleus
