#pragma once

/// A tool given by a surface of triangles (segments in 2D).

#include "forge/facet_tree.hpp"
#include "forge/tool_shape.hpp"

namespace malleus::forge {

/// What a look at a surface found.
struct SurfaceReport {
  bool closed = true;          ///< no border edges
  bool turned = false;         ///< all facets were turned, their normals having pointed into the solid
  LocalId dropped_facets = 0;  ///< without area
};

/// Signed distance by the closest facet, the side by angle-weighted pseudonormals (Baerentzen, Aanaes 2005), which is
/// right for any closed surface, and for an open one in front of and behind it. Normals are smoothed: interpolated
/// between corners within patches bent by less than `feature_angle` [degrees] an edge; sharp edges stay sharp, and at
/// concave ones each patch holds the material by itself.
/// The set: points merged (a point per vertex), facets turned alike. Else InputError.
std::unique_ptr<ToolShape> make_surface(FacetSet set, Side side, SurfaceReport& report, Real feature_angle = 40);

}  // namespace malleus::forge
