#pragma once

/// Which parts meet at the nodes, and to which of them a node belongs.

#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

/// Nodes owned by this rank around which elements of more than one part lie.
struct SplitNodes {
  std::vector<LocalId> nodes;
  std::vector<std::int64_t> start;  ///< [split node + 1]
  std::vector<int> parts;           ///< increasing for each node
  std::vector<int> part_of_node;    ///< [owned node] its only part, or -1

  std::span<const int> of(std::size_t i) const {
    return {parts.data() + start[i], static_cast<std::size_t>(start[i + 1] - start[i])};
  }
};

/// parts: [element]. Collective.
SplitNodes find_split_nodes(const Communicator& comm, const Mesh& mesh, std::span<const int> parts);

/// The parts around every local node between parts, copies included; nothing at other nodes.
struct AroundNodes {
  std::vector<std::int64_t> start;  ///< [node + 1]
  std::vector<int> parts;           ///< increasing for each node

  std::span<const int> of(LocalId node) const {
    const auto n = static_cast<std::size_t>(node);
    return {parts.data() + start[n], static_cast<std::size_t>(start[n + 1] - start[n])};
  }
};

/// Owners tell the holders of copies which parts are around their nodes. Collective.
AroundNodes spread_split_nodes(const Communicator& comm, const Mesh& mesh, const SplitNodes& split);

/// The part of every local node, copies included: [node]. Split nodes go one by one to the part around them with the
/// least to do (elements and nodes, by speed), in sweeps. On several ranks each counts on the others doing as it does.
/// Collective.
std::vector<int> assign_nodes(const Communicator& comm, const Mesh& mesh, const SplitNodes& split,
                              const WorkModel& model, const Architecture& architecture, std::span<const int> parts);

}  // namespace malleus
