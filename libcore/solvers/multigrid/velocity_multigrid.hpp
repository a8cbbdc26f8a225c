#pragma once

/// Smoothed-aggregation multigrid for the velocity block of a Stokes system.

#include <memory>
#include <string>
#include <vector>

#include "fem/node_constraints.hpp"
#include "solvers/multigrid/coarse_space.hpp"

namespace malleus {

struct MultigridSettings {
  bool rigid_modes = false;         ///< rotations on coarse levels, besides translations
  bool double_precision = false;    ///< of the cycle; the set-up is always in double precision
  Real threshold = 0.25;            ///< of strong couplings, see aggregate()
  LocalId coarsest_unknowns = 600;  ///< solved directly, on one rank
  LocalId nodes_per_rank = 500;     ///< levels with fewer nodes a rank are gathered onto fewer ranks
  int max_levels = 12;
};

/// One line of the hierarchy's table; the same on all ranks.
struct MultigridLevelSummary {
  GlobalId nodes = 0;
  int block = 0;
  Real entries_per_row = 0;
  int active_ranks = 0;
};

/// A symmetric cycle of block Gauss-Seidel, one sweep before and one after each correction, between ranks block Jacobi;
/// the first two levels below the finest are visited twice.
class VelocityMultigrid {
 public:
  virtual ~VelocityMultigrid() = default;

  /// correction = one cycle on A correction = residual, from zero. [owned node][dim]. A scalar multiple of the
  /// residual gives the same multiple. Collective among neighbours.
  virtual void apply(const Real* residual, Real* correction) = 0;
  virtual const std::vector<MultigridLevelSummary>& levels() const = 0;
  virtual Real operator_complexity() const = 0;  ///< entries of all levels over those of the finest
  virtual std::size_t bytes() const = 0;         ///< held by this rank
};

/// finest: layout, graph, values (dim x dim), points and left_out filled. constraints: of its owned nodes.
/// Collective.
std::unique_ptr<VelocityMultigrid> make_velocity_multigrid(const Communicator& comm, MultigridLevel finest,
                                                           const NodeConstraints& constraints,
                                                           const MultigridSettings& settings);

/// The same for one unknown a node: blocks of 1 x 1, points all 0 and as many as owned nodes. Collective.
std::unique_ptr<VelocityMultigrid> make_scalar_multigrid(const Communicator& comm, MultigridLevel finest,
                                                         const MultigridSettings& settings);

}  // namespace malleus
