#pragma once

/// Nodes that exchange data without a common element, as the pairs of a contact do: edges of the workload beside those
/// of the mesh.

#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Data exchanged between two nodes when they belong to different parts, in the data of a cut mesh edge.
struct NodeCoupling {
  GlobalId first = 0;  ///< global node number
  GlobalId second = 0;
  Real weight = 1;  ///< > 0
};

/// A coupling of an element of this rank with any other.
struct ElementCoupling {
  LocalId element = 0;
  GlobalId other = 0;       ///< global element number
  std::int32_t weight = 1;  ///< >= 1, in edges of the dual graph
};

/// A coupling whose nodes belong to different parts.
struct CutCoupling {
  int part = 0;
  int other = 0;
  Real weight = 1;
};

/// Couplings as edges between the elements that stand for their nodes (of those around a node the first), summed over
/// equal pairs: of this rank's elements, increasing by element and other; each coupling is seen from both sides. An
/// edge weighs what its couplings do, rounded, at least 1; couplings within an element are left out. elements: the
/// layout. Each coupling may be given on any one rank. Collective.
std::vector<ElementCoupling> couple_elements(const Communicator& comm, const Mesh& mesh, const Ownership& elements,
                                             const std::vector<NodeCoupling>& couplings);

/// Those of the given couplings that are cut. part_of_node: [local node]. Collective.
std::vector<CutCoupling> cut_couplings(const Communicator& comm, const Mesh& mesh,
                                       const std::vector<NodeCoupling>& couplings, std::span<const int> part_of_node);

}  // namespace malleus
