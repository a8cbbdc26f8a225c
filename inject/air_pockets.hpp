#pragma once

/// The air that is left in a cavity: where it is, and whether it can still leave.

#include <array>
#include <vector>

#include "inject/front_set.hpp"

namespace malleus::inject {

/// A region that no front has filled, connected through elements. The same on all ranks.
struct AirPocket {
  Real volume = 0;              ///< m^3
  std::array<Real, 3> place{};  ///< its centroid, m
  bool is_vented = false;       ///< it reaches an open part of a vent, or another opening of the boundary
};

/// Largest first. More than 10,000 regions are not told apart: one pocket then, taken for vented. Collective.
std::vector<AirPocket> find_air_pockets(const Scene& scene, const FrontSet& fronts);

}  // namespace malleus::inject
