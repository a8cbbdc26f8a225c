#pragma once

/// Division of a mesh among processors, and its repair in place: MeshMigration for unequal machines (paper, 3.1).

#include <map>
#include <span>
#include <string>
#include <vector>

#include "partition/pair_refiner.hpp"
#include "partition/partition_cost.hpp"

namespace malleus {

enum class Partitioner {
  refined,  ///< the best geometric start, refined; from a given partition what costs least, diffusion or anew
  curve,    ///< stretches of the space-filling curve, as they come
  strips,   ///< the paper's migration of strips, from the given partition or the curve's
  keep,     ///< the given partition as it is, for its measures
};

/// What a new partition is refined from.
enum class PartitionStart {
  best,        ///< one of the next four, whichever cuts least on a coarse graph
  curve,       ///< stretches of the space-filling curve
  coordinate,  ///< recursive coordinate bisection
  inertial,    ///< recursive inertial bisection
  growth,      ///< recursive bisection by edges, of a coarse graph (grow_bisect.hpp)
  scotch,      ///< PT-Scotch (scotch_start.hpp)
};

struct PartitionOptions {
  Partitioner method = Partitioner::refined;
  Real tolerance = 0.01;  ///< imbalance of the work aimed at
  PartitionStart start = PartitionStart::best;
  bool starts_anew = false;  ///< a given partition is compared with a new one, not repaired
  /// Cost of moving everything once, in increments, over the increments until the next repair: by it a plan that moves
  /// less is preferred to one that costs less per increment.
  Real moving_cost = 0.05;
};

/// A partition as a value: it can be looked at, written, compared and refused before anything is moved.
struct PartitionPlan {
  std::vector<int> parts;  ///< [element] of this rank
  PartitionCost before;    ///< of the given partition; where none was given, as after
  PartitionCost after;
  Real moved = 0;                       ///< share of the work that changes part; 0 where no partition was given
  GlobalId moved_elements = 0;          ///< over all ranks
  std::string made_by;                  ///< what was chosen, in words
  RefinementCount count;                ///< of all that was tried
  std::map<std::string, Real> seconds;  ///< wall time by phase, largest over the ranks
  Real processor_seconds = 0;           ///< to divide the graph, of the rank that used most
  Real graph_processor_seconds = 0;     ///< to make the graph from the mesh, likewise
};

/// Divides the elements of a mesh among the parts of an architecture, on any number of ranks; the mesh stays where it
/// is. from: [element] the present part in [0, parts), or empty on all ranks where there is none. The same mesh on the
/// same ranks gives the same plan. Collective.
PartitionPlan make_partition(const Communicator& comm, const Mesh& mesh, const WorkModel& model,
                             const Architecture& architecture, const PartitionOptions& options,
                             std::span<const int> from = {});

/// What a plan costs and moves, in words; several lines. Local.
std::string describe_plan(const PartitionPlan& plan);

/// Whether a plan gains more than `least_gain` of the present cost, and more than moving costs (options.moving_cost):
/// else it is to be refused. Local, the same on all ranks.
bool is_worth_moving(const PartitionPlan& plan, const PartitionOptions& options, Real least_gain);

/// Elements, of all ranks, to which two plans for one mesh give different parts; 0: the plans are alike. Collective.
GlobalId count_differences(const Communicator& comm, const PartitionPlan& one, const PartitionPlan& other);

}  // namespace malleus
