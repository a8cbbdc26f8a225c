#pragma once

/// Regular refinement: every edge is halved.

#include "field/field.hpp"

namespace malleus {

/// Cuts every triangle in 4 and every tetrahedron in 8 (its inner octahedron along the shortest diagonal), groups and
/// regions likewise; new nodes are the middles of straight edges. Fields follow: nodes' values linearly, elements'
/// values as they are. element_ids end. Each rank keeps its part. InputError beyond 3e9 nodes. Collective.
void subdivide(const Communicator& comm, Mesh& mesh, FieldStore& fields);

}  // namespace malleus
