#pragma once

/// Meshes of Mmg, Medit and their kin, with the names of groups that their format has no place for.

#include <string>

#include "mesh/distribute.hpp"

namespace malleus {

/// Reads a .mesh or .meshb file; the root holds the file's content until it is distributed. References of elements and
/// boundary facets are the regions and groups; a file beside it with the ending .names, as write_medit_mesh() makes it,
/// tells their names, else their numbers are the names. Boundary facets of reference 0 have no group; where all
/// elements have reference 0 there is one region "default". length_unit: metres per unit of the file. InputError.
/// Collective.
MeshChunk read_medit_mesh(const Communicator& comm, const std::string& path, Real length_unit = 1);

/// Writes a .mesh or .meshb file in m, by rank through the root: regions and groups as references 1, 2, ...; facets
/// without a group are left out. Beside it a .names file: lines of dimension, reference, name. StorageError.
/// Collective.
void write_medit_mesh(const Communicator& comm, const Mesh& mesh, const std::string& path);

}  // namespace malleus
