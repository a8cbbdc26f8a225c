#pragma once

/// Where nothing is modelled: regions of elements that hold void alone, and the pressures in them.

#include <array>
#include <vector>

#include "inject/front_set.hpp"
#include "mesh/node_regions.hpp"

namespace malleus::inject {

/// A region of void elements, connected by shared nodes. The same on all ranks but for `elements`.
struct VoidRegion {
  Real volume = 0;                ///< m^3, with the void share of the elements that the front cuts at its border
  std::array<Real, 3> place{};    ///< its centroid, m
  bool is_vented = false;         ///< it reaches a vent that is open, or another opening of the boundary
  Real pressure = 0;              ///< of that opening, Pa
  std::vector<LocalId> elements;  ///< of this rank
};

/// Regions of void, and which one each node touches ([node], -1 = none). In the order of their lowest global node.
struct VoidRegions {
  std::vector<VoidRegion> regions;
  std::vector<std::int32_t> of_node;
};

/// Elements all of whose volume is void are those of `mixture` as it was last updated. More than 10,000 regions are not
/// told apart: all are vented then, at no pressure. Collective.
VoidRegions find_void_regions(const Scene& scene, const FrontSet& fronts, const Mixture& mixture, Real time);

}  // namespace malleus::inject
