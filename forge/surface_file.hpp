#pragma once

/// Surfaces of tools from files.

#include <string>

#include "forge/facet_tree.hpp"

namespace malleus::forge {

/// Reads STL, ASCII or binary (told apart by content and size), or a gmsh mesh (.msh: its triangles, in 2D its lines;
/// all else in it is passed over), by ending. Coordinates are multiplied by `length_unit` [m]. Points that coincide
/// exactly, or within 1e-9 of the surface's extent, become one. Facets from gmsh are turned like the first one that
/// they are joined to. InputError that names the file, and the line where it has lines. Local.
FacetSet read_surface_file(const std::string& path, int dim, Real length_unit);

/// The same for STL text or bytes already in memory; `name` is for messages.
FacetSet parse_stl(const std::string& content, const std::string& name, Real length_unit);

/// Turns facets until neighbours over a ridge (3D: an edge, 2D: a point) look to the same side as the first of each
/// connected part. Where that cannot be (a Moebius strip, three facets at an edge) some do not.
void turn_alike(FacetSet& set);

/// Merges points that lie within `tolerance` [m] of each other, and drops facets that lose a corner by it.
FacetSet merge_points(const FacetSet& loose, Real tolerance);

}  // namespace malleus::forge
