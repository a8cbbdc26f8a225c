#pragma once

/// Makes a level set a signed distance again, without moving its volume.

#include <span>

#include "mesh/mesh.hpp"
#include "mesh/node_graph.hpp"

namespace malleus {

/// Slope of the level set over the cut elements of all ranks.
struct FrontSlope {
  Real smallest = 1;  ///< |grad level_set| [1]
  Real largest = 1;
  Real share_outside = 0;  ///< of the cut elements: slope outside [1/3, 3]
  GlobalId cut_elements = 0;
};

/// Collective.
FrontSlope front_slope(const Communicator& comm, const Mesh& mesh, std::span<const Real> level_set);

/// Whether the slope asks for a redistance: more than a tenth of the cut elements lie outside [1/3, 3]. Redistancing by
/// the clock moves the front more than it mends (reversed vortex: 18 % error without, 26 to 43 % every 50 to 10 steps).
bool should_redistance(const FrontSlope& slope);

/// Replaces the level set by the signed distance to its own zero facets, then shifts it to the positive volume it had.
/// Nodes that no path of edges joins to the front keep their value. measures: [element], level_set_volume.hpp.
/// Does nothing where there is no front. Collective.
void redistance(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph, std::span<const Real> measures,
                std::span<Real> level_set);

}  // namespace malleus
