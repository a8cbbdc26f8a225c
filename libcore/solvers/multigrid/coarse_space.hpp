#pragma once

/// Prolongators of smoothed aggregation: near-kernel modes on aggregates, smoothed by a Jacobi step.

#include "fem/node_constraints.hpp"
#include "parallel/communicator.hpp"
#include "solvers/multigrid/aggregation.hpp"

namespace malleus {

/// What a level is to the next one. The unknowns of a fine node are its velocity; those of a coarse node a translation
/// and, with rigid modes, a rotation times `scale`, about the node's point.
struct MultigridLevel {
  BlockLayout layout;
  BlockGraph graph;             ///< rows of the owned nodes
  BlockValues<Real> values;     ///< block x block, block = dim or the number of modes
  std::vector<Real> inverses;   ///< [owned node][block*block] of the diagonal blocks, column by column; ends padded
  std::vector<Real> points;     ///< [owned node][dim], m
  std::vector<bool> left_out;   ///< [owned node] fully fixed: its row is diagonal
  Real scale = 1;               ///< m
  Real largest_eigenvalue = 0;  ///< of D^-1 A, estimated from below
  bool has_rotations = false;   ///< unknowns of a node are dim translations and dim(dim-1)/2 rotations
};

struct Prolongator {
  BlockLayout layout;        ///< of the coarse nodes that the rows refer to
  BlockGraph graph;          ///< a row per owned fine node
  BlockValues<Real> values;  ///< block x modes
};

/// Number of modes a coarse node carries.
constexpr int coarse_modes(int dim, bool rigid) {
  return rigid ? dim * (dim + 1) / 2 : dim;
}

/// Fills level.inverses: (pseudo-)inverses of the diagonal blocks. Directions of a coarse block whose stiffness is
/// below 1e-9 of its largest (rotations of a single node) get none. Local.
void invert_diagonals(MultigridLevel& level);

/// Fills level.largest_eigenvalue by power iteration from a fixed start. Collective.
void estimate_largest_eigenvalue(const Communicator& comm, MultigridLevel& level);

/// How an aggregate can move as a whole.
struct AggregateModes {
  int dim = 3;
  bool rigid = false;  ///< rotations besides translations
};

/// Points [coarse owned][dim] of the aggregates and their scale, and P = (I - omega D^-1 A) P0 with omega = 4/(3
/// lambda): P0 the modes on aggregates. Where i and j are coupled weakly, A_ij meets the modes of i's aggregate at j in
/// place of those of j's (Vanek's filtered matrix, made to keep rotations as well): on flattened elements the coarse
/// rows stay short. coarse: ownership of the aggregates, numbered rank after rank.
/// constraints: of the level's owned nodes, more do no harm; null on coarse levels. Collective.
struct CoarseSpace {
  Prolongator prolongator;
  std::vector<Real> points;  ///< [coarse owned][dim]
  Real scale = 1;
};
CoarseSpace make_coarse_space(const Communicator& comm, const MultigridLevel& level, const Aggregates& aggregates,
                              const Ownership& coarse, AggregateModes modes, const NodeConstraints* constraints);

}  // namespace malleus
