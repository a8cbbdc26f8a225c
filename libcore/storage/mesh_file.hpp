#pragma once

/// The project's own mesh file: partitioned HDF5, with an XDMF beside it for ParaView.

#include <filesystem>

#include "field/fielded_piece.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// Writes PATH.h5 by all ranks at once, a group /pRRRR per partition that holds elements (float64 coordinates, global
/// node numbers, regions, groups, file places, node and element fields), and PATH's .xdmf beside it. Made under a
/// temporary name, sealed with a checksum over all its bytes, and renamed. StorageError. Collective.
void write_mesh_file(const Communicator& comm, const std::filesystem::path& path, const Mesh& mesh,
                     const FieldStore& fields);

/// The same with any number of partitions: parts [element] in [0, n_parts). This rank writes, and its mesh holds
/// elements of, the parts from first_part_of_rank(n_parts, rank, ranks) to that of the next rank. Collective.
void write_mesh_file(const Communicator& comm, const std::filesystem::path& path, const Mesh& mesh,
                     const FieldStore& fields, std::span<const int> parts, int n_parts);

/// Where parts are dealt to ranks in stretches. Local.
int first_part_of_rank(int n_parts, int rank, int ranks);

/// A mesh file as read: partitions dealt to the ranks in stretches, so that on as many ranks as wrote it each gets
/// its own; on others ranks may be empty or unequal. Fields come declared in the store. Elements of a file without
/// element places are given their place in it.
/// length_unit: m per unit of the file. InputError where the file is damaged or no mesh file of ours. Collective.
Mesh read_mesh_file(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields);

}  // namespace malleus
