#pragma once

/// The error of space in a run's results, seen by solving one of its increments on coarser meshes as well.

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/extrapolation.hpp"
#include "engine/process.hpp"
#include "engine/rehearsal.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// The run's scene as a new process on another mesh. Collective; may throw.
using ProcessFactory = std::function<std::unique_ptr<Process>(Mesh)>;

/// What rehearsals on coarser meshes let one expect of a run on its own mesh. Processor times in s, over all ranks.
struct Outlook {
  Real increment_s = 0;  ///< of an increment after the first
  Real error = 0;        ///< of space, relative; 0 where only one coarser mesh could be made
  Real order = 1.75;     ///< at which it falls with the sizes
  Real increments = 1;   ///< of the whole run
  Real first_s = 0;      ///< of the start and the first increment
  Real making_s = 0;     ///< of making the coarser meshes: what an estimate of the error takes besides increments
  Real coarse_s = 0;     ///< of the first increment on all of them
  bool solves = false;   ///< linear systems
  Real other_error = 0;  ///< relative: of the sources other than space
  Real total_s() const { return first_s + (increments - 1) * increment_s; }
  /// With estimates of the error of space, of which a run makes one or two.
  Real total_s(int estimates) const { return total_s() + estimates * (making_s + coarse_s); }
};

/// Estimates of the error of space that a run makes: of its start, and half-way where results change. Local.
int estimates_of_run(const Process& process, const RunPlan& plan);

/// Repeats increments of a process on coarser meshes. Collective throughout.
class SpaceEstimate {
 public:
  /// without factory: never estimates, and looks ahead not at all.
  SpaceEstimate(const Communicator& comm, ProcessFactory factory) : comm_(comm), factory_(std::move(factory)) {}

  bool is_asked_for() const { return static_cast<bool>(factory_); }

  /// Keeps the present state on meshes of twice and three times the sizes, ahead of an increment.
  void prepare(Process& process);
  /// After that increment (none: of a scene that was solved as it stands): does the same there, and compares.
  void compare(Process& process, const std::optional<Increment>& increment);

  /// Of a process that has not started and is not used afterwards: runs it ahead on coarser meshes, and on its own
  /// where that is cheap, each to its end or until most_s processor seconds are spent, and extrapolates. None where no
  /// coarser mesh could be made or solved.
  std::optional<Outlook> look_ahead(Process& process, const RunPlan& plan, Real most_s);

  /// Of the last comparison; none where no coarser mesh could be made or solved.
  std::optional<ErrorShare> share(bool remeshes) const;

  nlohmann::json save() const { return saved_; }
  void restore(const nlohmann::json& saved) { saved_ = saved; }

 private:
  void make_twins(Process& process, bool compares);
  std::unique_ptr<Process> coarser(const Process& fine, FieldStore& fine_fields, Real coarsening) const;
  std::optional<std::vector<Real>> results_of(Process& process, const std::optional<Increment>& increment) const;

  const Communicator& comm_;
  ProcessFactory factory_;
  std::vector<std::unique_ptr<Process>> twins_;  ///< from the finer to the coarser
  nlohmann::json saved_;                         ///< error, order, dimension of the last comparison; null before it
};

}  // namespace malleus
