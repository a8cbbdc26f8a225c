#pragma once

#include "mesh/distribute.hpp"
#include "support/box_mesh.hpp"

namespace malleus::test {

/// 5 x 4 cells, in space times 3.
BoxMeshOptions small_box(int dim);

/// Sparse node numbers, with a large stride between blocks. Local.
GlobalId renumbered(GlobalId number);

/// The test box as a reader might meet it: each rank holds the nodes, elements and facets of its slab, the elements
/// shuffled, the nodes renumbered() from those of box_piece(). Nodes between slabs are given by both ranks. Collective.
MeshChunk box_chunk(const BoxMeshOptions& options);

}  // namespace malleus::test
