#pragma once

/// What the module with gmsh in it offers. gmsh comes with many libraries, whose loading takes a tenth of a second and
/// 30 MB: a module of its own, loaded where a CAD file is given, spares all other commands that.

#include <string>

#include "mesh/distribute.hpp"

namespace malleus::meshtool {

/// Meshes a CAD file with elements of a size, see mesh_cad_file(). Returns why it could not, empty if it could. Local.
using CadMesher = std::string(const std::string& path, Real size, Real length_unit, MeshChunk& chunk);

inline constexpr const char* cad_module = "libmalleus_cad.so";        ///< beside the program
inline constexpr const char* cad_mesher_name = "malleus_cad_mesher";  ///< of the function below

}  // namespace malleus::meshtool

extern "C" malleus::meshtool::CadMesher* malleus_cad_mesher();
