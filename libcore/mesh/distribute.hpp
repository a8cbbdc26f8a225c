#pragma once

/// From a mesh in loose pieces, read by any ranks in any order, to one piece a rank, ready for assembly.

#include "mesh/assemble.hpp"

namespace malleus {

/// What one rank read of a mesh: some nodes, some elements, some named facets, not related to each other and perhaps
/// none of them. Together the chunks of all ranks are the mesh. A reader fills it and calls distribute_mesh().
struct MeshChunk {
  std::string source;  ///< name of the file, for messages
  int dim = 3;
  std::vector<std::string> region_names;  ///< same on all ranks
  std::vector<std::string> group_names;   ///< same on all ranks

  std::vector<GlobalId> node_numbers;   ///< >= 0, sparse or not; a number may be repeated at the same place
  std::vector<Real> coordinates;        ///< [node][dim], m, finite
  std::vector<GlobalId> element_nodes;  ///< [element][dim+1], node numbers; any orientation
  std::vector<std::int32_t> element_region;
  std::vector<GlobalId> element_ids;      ///< one an element, unique over the ranks: its place in the file
  std::vector<GlobalId> element_weights;  ///< empty = 1 each; what the ranks shall hold equal amounts of
  std::vector<GlobalId> facet_nodes;      ///< [facet][dim], node numbers; any orientation
  std::vector<std::int32_t> facet_group;
};

/// Tells all ranks the dimension and names of the chunk that the root alone has filled. Collective.
void share_head(const Communicator& comm, MeshChunk& chunk);

/// What was found on the way, of the whole mesh: the same on all ranks.
struct DistributionReport {
  GlobalId repeated_nodes = 0;         ///< node numbers given again at the same place; taken once
  GlobalId unused_nodes = 0;           ///< of no element; left out
  GlobalId inverted_elements = 0;      ///< of negative volume as given; assemble_mesh() turns them
  GlobalId repeated_elements = 0;      ///< same nodes as an earlier element; left out
  GlobalId repeated_facets = 0;        ///< same nodes as an earlier facet; the first one's group holds
  std::vector<GlobalId> loose_facets;  ///< [group]: facets that are no face of an element; left out
};

struct DistributedPiece {
  MeshPiece piece;
  DistributionReport report;
};

/// Divides the elements along a Hilbert curve through their centroids in stretches of equal weight and sends each
/// rank its elements, their nodes and their named facets. Cost on a rank: its share; no rank holds the mesh. The same
/// chunks on the same ranks give the same pieces. InputError where an element has a node that is not given or has one
/// twice, and where a node is given twice at different places. Collective.
DistributedPiece distribute_mesh(const Communicator& comm, MeshChunk chunk);

/// distribute_mesh() and assemble_mesh(); loose facets are an InputError. numbers: if given, receives the node numbers of
/// the chunks, [node] of the mesh. Collective.
Mesh build_mesh(const Communicator& comm, MeshChunk chunk, std::vector<GlobalId>* numbers = nullptr);

}  // namespace malleus
