#pragma once

/// A scene run ahead on a coarse mesh, to tell what it will take on its own.

#include <limits>
#include <optional>
#include <vector>

#include "engine/process.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// Processor time that a forecast may take on each kind of mesh, s.
inline constexpr Real seconds_of_rehearsal = 3;

/// How a run goes on and ends, as [time] says. Times in s.
struct RunPlan {
  Real step = std::numeric_limits<Real>::infinity();
  Real end = std::numeric_limits<Real>::infinity();
  std::optional<GlobalId> increments;
  bool is_steady() const { return increments && *increments == 0; }
};

/// What was seen on a coarse mesh. Processor times in s, summed over the ranks.
struct Rehearsal {
  Real nodes = 0;
  Real first_s = 0;           ///< of the start and the first increment, which finds contacts and knows no flow yet
  Real later_s = 0;           ///< of a later increment, in the mean; as the first where there was none
  Real increments = 1;        ///< of the whole run, by its progress where it was not brought to its end
  Real done = 1;              ///< increments that were made
  bool solves = false;        ///< linear systems
  Real other_error = 0;       ///< relative: of the sources that the process itself can tell
  std::vector<Real> results;  ///< after the first increment
};

/// Runs a process that has not started, without any output, to its end or until most_s processor seconds are spent.
/// None where it cannot be set up or fails in its first increment. Collective.
std::optional<Rehearsal> rehearse(const Communicator& comm, Process& process, const RunPlan& plan, Real most_s);

/// The run on a mesh of so many nodes, from rehearsals on one coarser mesh or more (from the finer to the coarser):
/// times grow by a fixed part and one that goes with the nodes; where steps follow sizes there are more increments, and
/// the sources of error that steps leave are smaller. dim: of the mesh.
Rehearsal extrapolated_run(const std::vector<Rehearsal>& rehearsals, Real nodes, int dim, bool steps_follow_sizes);

}  // namespace malleus
