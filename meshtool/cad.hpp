#pragma once

/// Meshing of CAD files through libgmsh.

#include <string>

#include "mesh/distribute.hpp"

namespace malleus::meshtool {

/// Whether the ending is that of a CAD file: .step, .stp, .brep, .geo. Local.
bool is_cad_file(const std::string& path);

/// Meshes a CAD file with elements of a size, given like the file in its unit of length. The root meshes and holds the
/// result, which is distributed afterwards; groups are the file's physical groups, or "volume" and "surface" ("surface"
/// and "boundary" in 2D) where it has none. length_unit: metres per unit of the file. Collective.
MeshChunk mesh_cad_file(const Communicator& comm, const std::string& path, Real size, Real length_unit);

}  // namespace malleus::meshtool
