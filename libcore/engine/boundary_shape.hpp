#pragma once

/// The boundary of a scene in its own units, facet by facet, for judging its shape.

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/position.hpp"
#include "engine/scene_parts.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// The box around the scene, and half its largest edge as the unit of length.
struct BoundingFrame {
  Position middle = {};  ///< m
  Position half = {};    ///< edges' halves, m
  Real length = 0;       ///< m

  Position inside(const Position& point) const {
    Position scaled = {};
    for (std::size_t c = 0; c < 3; ++c) scaled[c] = (point[c] - middle[c]) / length;
    return scaled;
  }
};

/// Around all nodes. Collective.
BoundingFrame bounding_frame(const Communicator& comm, const Mesh& mesh);

/// A facet of the boundary in the units of the frame, with a quadrature exact for cubics (2D: Simpson's).
struct BoundaryFacet {
  std::vector<std::pair<Position, Real>> points;  ///< place and weight; the weights sum up to the area
  Position normal = {};
  Real area = 0;
};

/// Local.
BoundaryFacet boundary_facet(const Mesh& mesh, LocalId facet, const BoundingFrame& frame);

/// A facet with its class: that of its group within its region.
struct ClassedFacet {
  BoundaryFacet facet;
  std::size_t kind = 0;
  bool is_symmetry = false;
};

/// Classes of groups times regions.
inline std::size_t classes_of(const Mesh& mesh, const SceneParts& parts) {
  return parts.is_symmetry_plane.size() * mesh.region_names.size();
}

/// Exterior facets of this rank. Local.
template <class Work>
void for_each_boundary_facet(const Mesh& mesh, const SceneParts& parts, const BoundingFrame& frame, Work&& work) {
  for (LocalId facet = 0; facet < mesh.exterior_facets; ++facet) {
    const auto group = static_cast<std::size_t>(mesh.facet_group[static_cast<std::size_t>(facet)] + 1);
    const auto element = static_cast<std::size_t>(mesh.facet_element[static_cast<std::size_t>(facet)]);
    const auto kind = static_cast<std::size_t>(parts.class_of_group[group]);
    const auto region = static_cast<std::size_t>(mesh.element_region[element]);
    work(ClassedFacet{boundary_facet(mesh, facet, frame), region * parts.is_symmetry_plane.size() + kind,
                      parts.is_symmetry_plane[kind] != 0});
  }
}

}  // namespace malleus
