#pragma once

/// The promises of Mesh, checked one by one, for tests and tools.

#include <string>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Every broken promise of a mesh in a sentence, the same list on all ranks; empty where all hold. Checked: sizes and
/// ranges of all lists, names alike on all ranks, ownership and copies of nodes and their coordinates, positive
/// volumes, faces of at most two elements, the exterior facets complete and turned outward, inner facets listed once,
/// totals. Costs a few exchanges of all faces: not for every step. Collective.
std::vector<std::string> broken_promises(const Communicator& comm, const Mesh& mesh);

/// Throws a Defect that lists the broken promises, if any. Collective.
void verify_mesh(const Communicator& comm, const Mesh& mesh);

}  // namespace malleus
