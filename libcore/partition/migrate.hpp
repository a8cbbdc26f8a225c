#pragma once

/// Moving elements, with their nodes, facets and fields, between ranks.

#include <span>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// Where the entities of one rank went in a migration, for those who keep data of their own beside the fields.
struct MigrationReport {
  GlobalId moved_elements = 0;  ///< over all ranks: elements that changed rank
  GlobalId sent_bytes = 0;      ///< over all ranks, to other ranks
};

/// Moves each element to destinations[element] (a rank) and rebuilds the mesh there; all fields follow, references
/// to them stay valid. Copies of node fields must be up to date. Global node numbers change; element_ids and names
/// do not. A plan that moves nothing leaves the mesh as it is. Cost: what moves, plus a rebuild of what is local. What
/// goes to one rank may be of any size, it is sent in messages of at most piece_bytes. Collective.
MigrationReport migrate(const Communicator& comm, Mesh& mesh, FieldStore& fields, std::span<const int> destinations,
                        std::size_t piece_bytes = std::size_t{1} << 30);

}  // namespace malleus
