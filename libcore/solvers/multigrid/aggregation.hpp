#pragma once

/// Which fine nodes form a coarse one.

#include <vector>

#include "solvers/multigrid/block_rows.hpp"

namespace malleus {

struct Aggregates {
  std::vector<LocalId> of_node;  ///< [owned node]; -1 = not on the coarse level
  LocalId count = 0;
  std::vector<bool> strong;  ///< [entry] of the graph: a strong coupling, or the diagonal
};

/// Greedy aggregation of this rank's rows along strong couplings (Vanek, Mandel, Brezina 1996), in their order.
/// Nodes i and j are strong neighbours where |A_ij| >= threshold sqrt(m_i m_j), m_i the largest off-diagonal |A_ij| of
/// row i: measured on the off-diagonals, a contact penalty on the diagonal leaves its node with its neighbours.
/// dim: the norms are Frobenius norms of the leading dim x dim parts. left_out: [row] nodes that need no coarse level.
/// Collective among neighbours.
Aggregates aggregate(const BlockLayout& layout, const BlockGraph& graph, const BlockValues<Real>& values, int dim,
                     Real threshold, const std::vector<bool>& left_out);

}  // namespace malleus
