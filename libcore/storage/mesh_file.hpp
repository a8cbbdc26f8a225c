#pragma once

/// The project's own mesh file: partitioned HDF5, with an XDMF beside it for ParaView.

#include <filesystem>

#include "field/fielded_piece.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// Writes PATH.h5 by all ranks at once, a group /pRRRR per partition that holds elements (float64 coordinates, global
/// node numbers, regions, groups, file places, node and element fields, a checksum), and PATH's .xdmf beside it. Made
/// under a temporary name and renamed. StorageError. Collective.
void write_mesh_file(const Communicator& comm, const std::filesystem::path& path, const Mesh& mesh,
                     const FieldStore& fields);

/// A mesh file as read: partitions dealt to the ranks in stretches, so that on as many ranks as wrote it each gets
/// its own; on others ranks may be empty or unequal. Fields come declared in the store.
/// length_unit: m per unit of the file. InputError where the file is damaged or no mesh file of ours. Collective.
Mesh read_mesh_file(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields);

}  // namespace malleus
