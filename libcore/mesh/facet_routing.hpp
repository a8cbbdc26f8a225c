#pragma once

/// Finds, for facets that any rank read, the ranks whose elements have them as a face.

#include "mesh/assemble.hpp"

namespace malleus {

struct RoutedFacets {
  std::vector<LocalId> nodes;       ///< [facet][dim], indices of the piece's nodes
  std::vector<std::int32_t> group;  ///< [facet]
  GlobalId repeated = 0;            ///< facets with the nodes of an earlier one, of all ranks
  std::vector<GlobalId> loose;      ///< [group]: facets that are no face of any element, of all ranks
};

/// The facets among those given on all ranks, [facet][dim] node numbers, that are faces of the piece's elements. A
/// facet between two pieces comes to both. Of facets with the same nodes the first holds, by rank and place in its
/// list. Collective.
RoutedFacets route_facets(const Communicator& comm, const MeshPiece& piece, std::span<const GlobalId> facet_nodes,
                          std::span<const std::int32_t> facet_group);

}  // namespace malleus
