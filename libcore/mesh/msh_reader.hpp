#pragma once

/// Reading of gmsh's meshes: MSH 2.2 and 4.1, ASCII and binary.

#include <array>
#include <string>
#include <vector>

#include "mesh/distribute.hpp"

namespace malleus {

/// Reads a mesh, each rank its share of the records. Tetrahedra and triangles make a mesh of dimension 3; triangles
/// and lines one of dimension 2, which must lie in a plane z = constant. Physical groups become regions and groups by
/// name, or by number where they have no name; the first physical group of an element holds. Without physical groups
/// of volumes there is one region "default"; with some, every element must be in one. Boundary elements in no physical
/// group are left out. Anything that is not such a mesh is an InputError that names the file and the line or byte.
/// length_unit: metres per unit of the file, > 0. Every rank must see the file. Collective.
MeshChunk read_msh(const Communicator& comm, const std::string& path, Real length_unit = 1);

/// The triangles of an MSH file, or its lines, as a surface (a curve) in space.
struct MshSurface {
  std::vector<std::array<Real, 3>> points;     ///< unit of the file
  std::vector<std::array<LocalId, 3>> facets;  ///< indices in points; the third is -1 for lines
};

/// Reads the elements of facet_nodes (2: lines, 3: triangles) and passes over all others, in the order of the file.
/// InputError that names the file, and the line or byte. Local: for small files, on one rank or on each.
MshSurface read_msh_surface(const std::string& path, int facet_nodes);

}  // namespace malleus
