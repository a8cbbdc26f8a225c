#pragma once

/// Sums over a mesh that do not depend on orders, numbers and the division among ranks.

#include "mesh/mesh.hpp"

namespace malleus::test {

/// A mixture of the bits of a point's coordinates. Local.
std::uint64_t checksum_of_point(const Real* point, int dim);
/// A mixture for a set of points, from the sum of theirs. Local.
std::uint64_t checksum_of_simplex(std::uint64_t sum_of_points);

/// Sum over all nodes, each once; over all elements, with the name of their region; over all facets with a group, with
/// its name. Collective.
GlobalId checksum_of_nodes(const Mesh& mesh);
GlobalId checksum_of_elements(const Mesh& mesh);
GlobalId checksum_of_groups(const Mesh& mesh);

}  // namespace malleus::test
