#pragma once

/// Closed pockets of a far softer material (trapped air), whose volume the surrounding material must keep.

#include <cstdint>
#include <vector>

#include "fem/linear_system.hpp"

namespace malleus {

/// For a constant pressure in a closed pocket, M(1/eta) is wrong by the viscosity contrast: the pocket resists a change
/// of its volume with the viscosity of what surrounds it. One deflation vector a pocket, 1 on its nodes, mends that.
/// (Measured on 40,000 nodes at a contrast of 1e6: 30 pockets 254 iterations without, 43 with one vector
/// a pocket, 18 with those of parts as well where none has pockets 16.)
/// Where pockets hang together by a node or an edge alone, each part has next to a pressure of its own, held to that of
/// the others by the subscales of a few elements: the parts, without those nodes, have deflation vectors too.
struct SoftPockets {
  std::vector<std::int32_t> of_node;    ///< [owned node]: pocket, -1 = none
  std::vector<std::int32_t> part;       ///< [owned node]: pocket that is a part of a region, -1 = none
  std::vector<Real> volume;             ///< [pocket], m^3; the same on all ranks
  std::vector<Real> outside_viscosity;  ///< [pocket], Pa.s: mean of the firm elements that touch it; on all ranks
  /// [pocket], m^3/(Pa s): integral of e^2/eta over the firm elements at it, e = 1 on its nodes; on all ranks.
  std::vector<Real> rim;
  int open = 0;  ///< connected soft regions that are no pockets: vented, or most of the domain

  int count() const noexcept { return static_cast<int>(volume.size()); }
};

/// Soft: less than 1/30 of the mean viscosity of the firmer elements (those above the geometric mean of the extremes).
/// Regions are connected by shared nodes, on which the pressure is continuous. A region is vented, and must not be
/// deflated, where one of its nodes that touch no firm element can move so as to change its volume; it is no pocket
/// either where it has more than half the volume of the domain. The same holds for parts. Collective.
SoftPockets find_soft_pockets(const LinearSystem& system);

}  // namespace malleus
