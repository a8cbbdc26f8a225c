#pragma once

/// Lets a front follow a wall on which the fluid stands still.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"
#include "mesh/node_graph.hpp"

namespace malleus {

/// With no slip, transport never moves the front's contact with the wall, and a film below an element stays on it (gate
/// pressure 21 to 27 % too low in a channel). So each wall node takes the level set of its nearest node off the wall,
/// through an edge, less a hundredth of the edge (the front meets the wall at 89.4 degrees). A wall node all of whose
/// neighbours lie on the wall takes that of its nearest neighbour that has one to give. The volume has to be restored
/// afterwards.
class WallWetting {
 public:
  /// is_wall: [node], alike on all holders of a node. Collective.
  WallWetting(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph, std::span<const char> is_wall);

  /// Collective.
  void apply(std::span<Real> level_set) const;

  /// Wall nodes of all ranks that have no neighbour off the wall: there the section is one element thin.
  GlobalId nodes_without_interior() const noexcept { return without_interior_; }

 private:
  struct Transfer {
    LocalId from, to;
  };
  bool choose_givers(const Communicator& comm, const NodeGraph& graph, std::vector<char>& waits);

  const Mesh& mesh_;
  std::vector<std::vector<Transfer>> passes_;  ///< a pass's givers have their value before it begins
  std::vector<std::vector<LocalId>> taking_;   ///< by pass: the nodes, here or on another rank, that take a value
  GlobalId without_interior_ = 0;
};

}  // namespace malleus
