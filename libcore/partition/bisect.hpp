#pragma once

/// Recursive bisection of a graph by the places of its vertices.

#include <span>
#include <vector>

#include "partition/work_graph.hpp"

namespace malleus {

enum class BisectionAxis {
  coordinate,  ///< the longest side of the box of the vertices to be divided
  inertial,    ///< their principal axis of inertia
};

/// The part of each owned vertex: halves are halved again across the axis, all halves of a level at once, in proportion
/// to the shares of their parts (> 0). Places of cuts by histograms: a few reductions per level, of at most some
/// numbers per part. Collective.
std::vector<int> bisect(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares,
                        BisectionAxis axis);

}  // namespace malleus
