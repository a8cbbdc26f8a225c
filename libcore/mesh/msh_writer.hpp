#pragma once

/// Writing of meshes for gmsh.

#include <string>

#include "mesh/mesh.hpp"

namespace malleus {

struct MshFormat {
  int version = 4;  ///< 4 for MSH 4.1, 2 for MSH 2.2
  bool binary = true;
};

/// Writes one serial file: nodes by their global number + 1, named facets, then elements, both by rank. Regions and
/// groups are physical groups with tags 1, 2, ... and their names; facets without a group are left out. Coordinates
/// are in m and read back to the same bits. In 2D z = 0. Failures are StorageErrors; more than 2^31-1 nodes or elements
/// do not fit MSH 2.2 (InputError). Collective.
void write_msh(const Communicator& comm, const Mesh& mesh, const std::string& path, MshFormat format = {});

}  // namespace malleus
