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
#include "parallel/communicator.hpp"

namespace malleus {

/// The run's scene as a new process on another mesh. Collective; may throw.
using ProcessFactory = std::function<std::unique_ptr<Process>(Mesh)>;

/// What the first increment on coarser meshes lets one expect of the first on the process' own.
struct Outlook {
  Real increment_s = 0;  ///< wall time
  Real error = 0;        ///< of space, relative; 0 where only one coarser mesh could be made
  Real order = 1.75;     ///< at which it falls with the sizes
};

/// Repeats increments of a process on coarser meshes. Collective throughout.
class SpaceEstimate {
 public:
  /// without factory: never estimates.
  SpaceEstimate(const Communicator& comm, ProcessFactory factory) : comm_(comm), factory_(std::move(factory)) {}

  bool is_asked_for() const { return static_cast<bool>(factory_); }

  /// Keeps the present state on meshes of twice and three times the sizes, ahead of an increment.
  void prepare(Process& process);
  /// After that increment (none: of a scene that was solved as it stands): does the same there, and compares.
  void compare(Process& process, const std::optional<Increment>& increment);

  /// After prepare() on a process that has not started: starts there, does the first increment (steady: solves the
  /// scene as it stands), and extrapolates. largest_step: s. None where no coarser mesh could be made or solved.
  std::optional<Outlook> look_ahead(const Process& process, Real largest_step, bool steady);

  /// Of the last comparison; none where no coarser mesh could be made or solved.
  std::optional<ErrorShare> share(bool remeshes) const;

  nlohmann::json save() const { return saved_; }
  void restore(const nlohmann::json& saved) { saved_ = saved; }

 private:
  std::unique_ptr<Process> coarser(const Process& finest, const Process& fine, FieldStore& fine_fields,
                                   Real coarsening) const;
  std::optional<std::vector<Real>> results_of(Process& process, const std::optional<Increment>& increment) const;

  std::optional<std::vector<Real>> first_results_of(Process& twin, Real largest_step, bool steady) const;

  const Communicator& comm_;
  ProcessFactory factory_;
  std::vector<std::unique_ptr<Process>> twins_;  ///< from the finer to the coarser
  nlohmann::json saved_;                         ///< error, order, dimension of the last comparison; null before it
};

}  // namespace malleus
