#pragma once

/// Which master facet each slave node of a pair of bodies meets, whatever ranks they are on.

#include "forge/free_surface.hpp"

namespace malleus::forge {

/// A slave node before the closest place of the master's surface.
struct NodeFacetPair {
  LocalId slave = -1;                              ///< owned node
  std::size_t surface = 0;                         ///< its place in FreeSurface::nodes()
  std::array<GlobalId, 3> masters = {-1, -1, -1};  ///< nodes of the facet; the third is -1 in 2D
  std::array<Real, 3> weights = {0, 0, 0};         ///< of the closest place: >= 0, sum 1
  Vector normal = Vector::UnitX();                 ///< smoothed, unit, out of the master
  Real gap = 0;                                    ///< m along the normal; negative = penetration
};

struct PairSearch {
  std::int32_t slave_body = 0;   ///< region
  std::int32_t master_body = 1;  ///< region
  Real reach = 0;                ///< m: nodes farther from the master are left out
};

/// For every slave node within reach of a master facet that faces it, the closest such facet. Each rank builds a tree
/// of boxes over its master facets; slave nodes are sent to the ranks whose master facets may be within reach, and the
/// nearest answer counts: the cost follows the surfaces near each other, beside one box a rank. positions: [local
/// node], at which distances are measured; facets' normals are those of the surface's coordinates. Collective.
std::vector<NodeFacetPair> find_pairs(const Communicator& comm, const FreeSurface& surface,
                                      std::span<const Vector> positions, const PairSearch& search);

}  // namespace malleus::forge
