#pragma once

/// Meshes in all formats that meshtool reads and writes, by the ending of the file's name.

#include <string>

#include "engine/load_mesh.hpp"
#include "field/field.hpp"
#include "mesh/distribute.hpp"
#include "mesh/msh_writer.hpp"

namespace malleus::meshtool {

/// The endings known, for messages and help texts: ".msh, .h5, ...". Local.
std::string mesh_endings();

/// InputError that names the known endings where a file has another. Local.
void refuse_unknown_ending(const std::string& path);

/// Reads a mesh, and the fields of a file that has some. length_unit: metres per unit of length in the file.
/// InputError. Collective.
Mesh read_mesh(const Communicator& comm, const std::string& path, Real length_unit, FieldStore& fields,
               Folds folds = Folds::refuse);

/// Reads a mesh as it stands in the file, in loose pieces, without fields. InputError. Collective.
MeshChunk read_chunk(const Communicator& comm, const std::string& path, Real length_unit);

/// Writes a mesh in m; fields where the format has room for them. msh: the form of .msh files. Collective.
void write_mesh(const Communicator& comm, const Mesh& mesh, const FieldStore& fields, const std::string& path,
                MshFormat msh = {});

}  // namespace malleus::meshtool
