#pragma once

/// How fast a front moves, in elements.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Size of the mesh at each node [m], valid on copies: edge of the regular simplex of the mean volume of the elements
/// around it. A sliver among them changes it little. Collective.
std::vector<Real> node_sizes(const Mesh& mesh);

/// Elements a second that a front crosses: the speed along its normal over the size of the mesh, as the mean of an even
/// power over the front, weighted by area. The eighth follows the fast parts (1/256 of the front at twice the speed of
/// the rest counts as much), yet a few elements where fluid squeezes past a closing vent do not rule it, as they
/// would a maximum; the second tells of the front as a whole. velocity: [node][dim] m/s; level_set, sizes: [node] m. 0
/// without a front. Collective.
Real front_crossing_rate(const Communicator& comm, const Mesh& mesh, std::span<const Real> sizes,
                         std::span<const Real> velocity, std::span<const Real> level_set, int power = 8);

}  // namespace malleus
