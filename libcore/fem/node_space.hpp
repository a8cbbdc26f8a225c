#pragma once

/// The nodes whose unknowns a rank reads and adds to: those of its mesh, and distant ones that contact couples to them.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Sets of nodes that are coupled though they share no element: a slave node and the nodes of its master facet, say.
/// Every node of a set is coupled with every other.
struct NodeTuples {
  std::vector<GlobalId> nodes;
  std::vector<std::size_t> offsets = {0};  ///< set i is nodes [offsets[i], offsets[i+1])

  void add(std::span<const GlobalId> set);
  std::size_t size() const noexcept { return offsets.size() - 1; }
  std::span<const GlobalId> operator[](std::size_t i) const {
    return std::span(nodes).subspan(offsets[i], offsets[i + 1] - offsets[i]);
  }
  bool operator==(const NodeTuples&) const = default;
};

/// Local numbering: the mesh's owned nodes, its copies, then foreign nodes: nodes of other ranks that no element here
/// has, in increasing global number.
class NodeSpace {
 public:
  /// wanted: global numbers that shall have a local number, in any order, repeated or not. Collective.
  NodeSpace(const Communicator& comm, const Mesh& mesh, std::span<const GlobalId> wanted);

  const Mesh& mesh() const noexcept { return *mesh_; }
  const Halo& halo() const noexcept { return halo_; }  ///< of owned nodes, copies and foreign nodes
  LocalId owned() const noexcept { return halo_.owned(); }
  LocalId nodes() const noexcept { return halo_.owned() + halo_.copies(); }
  GlobalId global_node(LocalId node) const noexcept;
  LocalId local_node(GlobalId number) const noexcept;  ///< -1 where it has none here

 private:
  const Mesh* mesh_;
  std::vector<GlobalId> foreign_;
  Halo halo_;
};

}  // namespace malleus
