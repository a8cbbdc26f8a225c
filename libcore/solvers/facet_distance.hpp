#pragma once

/// Distance from every node to the nearest of many facets spread over the ranks.

#include <vector>

#include "mesh/mesh.hpp"
#include "mesh/node_graph.hpp"

namespace malleus {

/// A segment (2D) or triangle (3D) known to the nodes of an element of this rank.
struct DistanceFacet {
  LocalId node = 0;                   ///< a node near the facet: where the search starts
  std::array<Real, 9> vertices = {};  ///< [vertex][dim], m
};

/// Unsigned distance [m] of each local node to the facets, of all ranks. Each node offers the nearest facet that it
/// knows to its neighbours, nearest nodes first; the ranks swap what changed at their interfaces until nothing does.
/// Exact near the facets, and elsewhere within what a facet handed on from a neighbour can miss (well below an edge).
/// Nodes farther than `limit`, and nodes that no path of edges joins to a facet, get `limit`. Collective.
std::vector<Real> distance_to_facets(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph,
                                     const std::vector<DistanceFacet>& facets, Real limit = 1e300);

}  // namespace malleus
