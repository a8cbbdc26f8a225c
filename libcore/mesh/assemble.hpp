#pragma once

/// From loose pieces of a mesh, as files, remeshers and migrations give them, to the distributed mesh.

#include "mesh/mesh.hpp"

namespace malleus {

/// Elements that shall live on this rank, with their nodes named by any global numbers that agree between ranks
/// (file numbers, numbers before a migration). Nothing is owned or shared yet.
struct MeshPiece {
  int dim = 3;
  std::vector<std::string> region_names;  ///< same on all ranks
  std::vector<std::string> group_names;   ///< same on all ranks

  std::vector<GlobalId> node_numbers;  ///< each node once, in any order
  std::vector<Real> coordinates;       ///< [node][dim], m
  std::vector<LocalId> element_nodes;  ///< [element][dim+1], indices in node_numbers; any orientation
  std::vector<std::int32_t> element_region;
  std::vector<GlobalId> element_ids;  ///< empty, or one an element
  std::vector<LocalId> facet_nodes;   ///< [facet][dim]: facets with a group, of elements of this piece
  std::vector<std::int32_t> facet_group;

  LocalId nodes() const noexcept { return static_cast<LocalId>(node_numbers.size()); }
  LocalId elements() const noexcept { return static_cast<LocalId>(element_region.size()); }
};

/// The mesh, and where the entities of the piece went.
struct AssembledMesh {
  Mesh mesh;
  std::vector<LocalId> node_of_piece;     ///< piece node -> mesh node
  std::vector<LocalId> element_of_piece;  ///< piece element -> mesh element
};

/// Numbers and orders the piece, turns elements of negative orientation, finds shared nodes, their owners and the
/// exterior facets. Cost: local size, and communication of the size of the interfaces. Every node of the piece must
/// belong to an element of it. Collective.
AssembledMesh assemble_mesh(const Communicator& comm, const MeshPiece& piece);

}  // namespace malleus
