#pragma once

/// Recursive bisection of a graph by its edges.

#include <span>
#include <vector>

#include "partition/work_graph.hpp"

namespace malleus {

/// The part of each owned vertex: halves are halved again, in proportion to the shares of their parts (> 0). Of each
/// set of vertices one half is grown from a vertex, always by the neighbour that adds least to the cut, from several
/// vertices in turn; each is refined (refine_pair), and the one that cuts least is kept (greedy graph growing: Karypis
/// and Kumar, 1998). Bodies that do not hang together are filled one after the other. For coarse graphs: each rank does
/// the same on a copy of all of it. Collective; the same graph gives the same parts.
std::vector<int> grow_bisect(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares);

}  // namespace malleus
