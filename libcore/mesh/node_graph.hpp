#pragma once

/// Which nodes share an element, over this rank's elements.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Neighbours of every local node through this rank's elements, the node itself among them, in increasing order.
/// Near the partition's interfaces the other ranks hold the rest of a node's neighbours.
struct NodeGraph {
  std::vector<std::int64_t> start;  ///< [nodes + 1]
  std::vector<LocalId> neighbours;

  std::span<const LocalId> of(LocalId node) const {
    const auto n = static_cast<std::size_t>(node);
    return {neighbours.data() + start[n], static_cast<std::size_t>(start[n + 1] - start[n])};
  }
};

/// Local.
NodeGraph build_node_graph(const Mesh& mesh);

}  // namespace malleus
