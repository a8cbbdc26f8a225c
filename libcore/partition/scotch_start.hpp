#pragma once

/// A first partition by PT-Scotch, where the program was built with it.

#include <span>
#include <vector>

#include "partition/work_graph.hpp"

namespace malleus {

/// Whether the program was built with PT-Scotch.
bool has_scotch();

/// The part of each owned vertex by PT-Scotch's default strategy on all ranks at once, in proportion to the shares of
/// the parts (> 0); it knows nothing of links. One thread, seeds set back: the same graph on the same ranks gives the
/// same parts. InputError without PT-Scotch, or where vertices, edges and parts are too many for its 32 bits.
/// Collective.
std::vector<int> scotch_parts(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares);

}  // namespace malleus
