#pragma once

/// Searches over all ranks for nodes that lie where they should not.

#include <span>
#include <string>
#include <vector>

#include "mesh/assemble.hpp"
#include "mesh/space_filling_curve.hpp"

namespace malleus {

/// How many places were found, and one of them.
struct Findings {
  GlobalId count = 0;
  std::array<Real, 3> place = {0, 0, 0};  ///< m, of the finding of lowest numbers; meaningless where count is 0
};

/// Pairs of different nodes of one region within `tolerance` [m] of each other. Every node of a piece is looked at,
/// with the regions of its elements. Collective.
Findings find_coincident_nodes(const Communicator& comm, const MeshPiece& piece, Real tolerance);

/// Exterior nodes that lie in an exterior facet of their region of which they are no corner: to within a share of the
/// facet's size. is_exterior: [element][dim+1], for each face of the piece whether it is a boundary of the mesh.
/// Counts nodes. Collective.
Findings find_hanging_nodes(const Communicator& comm, const MeshPiece& piece, std::span<const char> is_exterior,
                            Real share = 1e-7);

}  // namespace malleus
