#pragma once

/// A coarse graph whole on every rank.

#include <vector>

#include "partition/work_graph.hpp"

namespace malleus {

/// A graph of all ranks' vertices, in the order of their numbers, as a graph of `alone`, a communicator of this rank
/// alone. For coarse graphs of bounded size only. Collective.
WorkGraph replicate_graph(const Communicator& comm, const Communicator& alone, const WorkGraph& graph);

}  // namespace malleus
