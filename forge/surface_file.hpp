#pragma once

/// Surfaces of tools from files.

#include <string>

#include "forge/facet_tree.hpp"

namespace malleus::forge {

/// Reads STL, ASCII or binary (told apart by content and size), or a gmsh mesh (.msh, its triangles; in 2D its lines),
/// by ending. Coordinates are multiplied by `length_unit` [m]. STL points that coincide exactly, or within 1e-9 of the
/// surface's extent, become one. InputError that names the file, and the line where it has lines. Local.
FacetSet read_surface_file(const std::string& path, int dim, Real length_unit);

/// The same for STL text or bytes already in memory; `name` is for messages.
FacetSet parse_stl(const std::string& content, const std::string& name, Real length_unit);

/// Merges points that lie within `tolerance` [m] of each other, and drops facets that lose a corner by it.
FacetSet merge_points(const FacetSet& loose, Real tolerance);

}  // namespace malleus::forge
