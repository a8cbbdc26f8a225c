#pragma once

/// New numbers for the parts of a partition, so that as much as possible stays where it is.

#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

/// Renames the parts of `parts` [owned vertex]: pairs of a new part and an old one are joined by decreasing common
/// weight, among processors that are alike. Collective.
void relabel_parts(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                   std::span<const int> old_parts, std::vector<int>& parts);

}  // namespace malleus
