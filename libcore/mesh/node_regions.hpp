#pragma once

/// Regions of nodes that hang together through elements, found across ranks.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Which region each node is of. Regions count from 0 in the order of their lowest global node, alike on all ranks.
struct NodeRegions {
  std::vector<std::int32_t> of_node;  ///< [node], valid on copies; -1 = of none
  int count = 0;                      ///< of all ranks
  bool is_complete = true;            ///< false: more regions than asked for; none is given
};

/// joined: the nodes of an element (by its number) that are of one region; none or a single one is legal. The span is
/// read before the next call. most: more regions than that are not numbered, since sums over them would cost more than
/// they tell. Rounds of exchange: as many as a region crosses from rank to rank. Collective.
NodeRegions connected_regions(const Communicator& comm, const Mesh& mesh,
                              const std::function<std::span<const LocalId>(LocalId)>& joined, GlobalId most = 10'000);

}  // namespace malleus
