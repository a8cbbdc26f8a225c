#pragma once

/// Whether a scene could be modelled on less than its whole geometry: half of it, or a section in two dimensions.

#include <array>
#include <string>
#include <vector>

#include "engine/scene_parts.hpp"
#include "fem/facet.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// A line along one of the axes.
struct AxisLine {
  std::size_t axis = 0;   ///< x, y, z
  Position through = {};  ///< m
};

struct SimplerGeometry {
  std::array<bool, 3> is_mirrored = {};  ///< [axis] about the middle plane normal to it
  std::array<bool, 3> is_extruded = {};  ///< [axis] along it, between two planes of symmetry; 3D
  std::vector<AxisLine> revolutions;     ///< about the middle line, or where two planes of symmetry meet; 3D
  Position middle = {};                  ///< of the scene's bounds, m

  /// Lines for the plan. symmetry_section: how a plane of symmetry is written.
  std::vector<std::string> suggestions(const std::string& symmetry_section) const;
};

/// Judged by moments of the boundary's parts (each region's by itself), the turn of its normals about an axis, and the
/// scalars at some places around; curved boundaries as their facets allow (a cylinder of 16 facets and more is one).
/// Collective.
SimplerGeometry find_simpler_geometry(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                                      const SceneParts& parts);

}  // namespace malleus
