#pragma once

/// What the remesher reads and writes: a simplicial mesh of one rank, self-contained, in flat arrays.

#include <cstdint>
#include <span>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// Triangles (dimension 2) or tetrahedra (dimension 3) with regions, grouped boundary facets and named curves.
/// Facets need not be complete: an exterior facet that is not listed has group -1, as has an unlisted facet between
/// two regions. Facets inside a region (both sides alike) may be listed: they are kept as inner surfaces.
/// Elements may be inverted or flat on entry; none is afterwards unless RemeshReport says so.
struct RemeshMesh {
  int dimension = 3;
  std::vector<Real> coordinates;             ///< [node][dimension], m
  std::vector<LocalId> element_nodes;        ///< [element][dimension+1]
  std::vector<std::int32_t> element_region;  ///< [element]
  std::vector<LocalId> facet_nodes;          ///< [facet][dimension]
  std::vector<std::int32_t> facet_group;     ///< [facet], -1 = unnamed
  std::vector<LocalId> curve_nodes;          ///< [curve edge][2], 3D only: feature edges given or found
  std::vector<std::int32_t> curve_group;     ///< [curve edge], -1 = unnamed
  std::vector<LocalId> corners;              ///< nodes that must stay where they are, and stay nodes
  std::vector<std::uint8_t> frozen;          ///< [node] 1 = on a parallel interface; empty = none frozen
  std::vector<LocalId> origin;               ///< [node] after a remesh: the node's number before, -1 = a new node

  LocalId nodes() const { return static_cast<LocalId>(coordinates.size() / static_cast<std::size_t>(dimension)); }
  LocalId elements() const { return static_cast<LocalId>(element_region.size()); }
  LocalId facets() const { return static_cast<LocalId>(facet_group.size()); }
  LocalId curves() const { return static_cast<LocalId>(curve_group.size()); }

  std::span<const LocalId> nodes_of_element(LocalId element) const {
    const auto n = static_cast<std::size_t>(dimension) + 1;
    return {element_nodes.data() + static_cast<std::size_t>(element) * n, n};
  }
  const Real* point(LocalId node) const {
    return coordinates.data() + static_cast<std::size_t>(node) * static_cast<std::size_t>(dimension);
  }
};

/// Throws InputError where sizes of the arrays disagree, a node number is out of range, an element repeats a node, or
/// a coordinate is not finite. Local.
void check_arrays(const RemeshMesh& mesh);

/// Sum of the signed volumes of a region's elements [m^D], or of all with region = any_region.
inline constexpr std::int32_t any_region = -1000000;
Real signed_volume(const RemeshMesh& mesh, std::int32_t region = any_region);

}  // namespace malleus
