#pragma once

/// Contact pairs as edges of the workload, so that a partition keeps together what meets.

#include "forge/pair_search.hpp"
#include "forge/scene.hpp"
#include "partition/couplings.hpp"

namespace malleus::forge {

/// Data that a slave node and a node of its master facet exchange when they lie on different ranks, in those of a cut
/// mesh edge: one in each product with the matrix, as a mesh edge, and about as much again for the pair's block of the
/// matrix, which is sent in each Newton iteration (a dense block of both ends, some dozen numbers, against four numbers
/// in each of some dozen linear iterations).
inline constexpr Real contact_coupling = 2;

/// Each slave node with each node of its master facet. Local.
std::vector<NodeCoupling> couple_pairs(const Mesh& mesh, std::span<const NodeFacetPair> pairs);

/// Of all pairs of bodies, as they lie now: slave nodes within an edge of the slave's from the master. Collective.
std::vector<NodeCoupling> contact_couplings(const Scene& scene);

}  // namespace malleus::forge
