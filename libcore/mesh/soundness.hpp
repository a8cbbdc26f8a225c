#pragma once

/// Whether a mesh that someone gives us can be computed on, and if not, why.

#include <string>
#include <vector>

#include "mesh/distribute.hpp"

namespace malleus {

/// One kind of fault of a mesh.
struct MeshProblem {
  std::string kind;     ///< a fixed word: "hanging nodes"
  std::string message;  ///< a sentence with count and place
  GlobalId count = 0;
  bool is_fault = true;  ///< false: worth knowing, but the mesh is sound
};

/// All problems of a mesh as it was read, before it is assembled; the same on all ranks. Looked for: node numbers given
/// twice, unused nodes, coincident nodes of one region, elements given twice, inverted and flat elements, facets given
/// twice or of no element, faces of more than two elements, folds (two elements on
/// the same side of their face), boundary edges (in 2D nodes) at which more than two
/// boundary facets meet, hanging nodes, boundary facets without a group. Lengths in m. Collective.
std::vector<MeshProblem> find_problems(const Communicator& comm, const DistributedPiece& distributed);

}  // namespace malleus
