#pragma once

/// The error of space in a run's results, seen by solving one of its increments on coarser meshes as well.

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/process.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// The run's scene as a new process on another mesh. Collective; may throw.
using ProcessFactory = std::function<std::unique_ptr<Process>(Mesh)>;

/// Results on meshes of sizes h, r h and, where it could be made, a third one. |difference| is the sum over the results
/// of absolute differences over the sum of their absolute values on the finest mesh.
struct MeshComparison {
  Real first_ratio = 2;             ///< r: mean size of the second mesh over that of the first
  Real first_difference = 0;        ///< between the first and the second
  std::optional<Real> difference2;  ///< between the second and the third
  Real second_ratio = 2;            ///< mean size of the third mesh over that of the second
};

/// Order of convergence that the comparison shows, within [1, 4]; 2, that of the element, where there are two meshes or
/// the differences do not fall.
Real observed_order(const MeshComparison& comparison);
/// Richardson's estimate of the relative error on the finest mesh: difference / (r^order - 1).
Real extrapolated_error(const MeshComparison& comparison);

/// What the first increment on coarser meshes lets one expect of the first on the process' own.
struct Outlook {
  Real increment_s = 0;  ///< wall time
  Real error = 0;        ///< of space, relative; 0 where only one coarser mesh could be made
  Real order = 2;        ///< at which it falls with the sizes
};

/// Repeats increments of a process on coarser meshes. Collective throughout.
class SpaceEstimate {
 public:
  /// without factory: never estimates.
  SpaceEstimate(const Communicator& comm, ProcessFactory factory) : comm_(comm), factory_(std::move(factory)) {}

  bool is_asked_for() const { return static_cast<bool>(factory_); }

  /// Keeps the present state on meshes of twice and four times the sizes, ahead of an increment.
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
  std::unique_ptr<Process> coarser(const Process& fine, FieldStore& fine_fields) const;
  std::optional<std::vector<Real>> results_of(Process& process, const std::optional<Increment>& increment) const;

  std::optional<std::vector<Real>> first_results_of(Process& twin, Real largest_step, bool steady) const;

  const Communicator& comm_;
  ProcessFactory factory_;
  std::vector<std::unique_ptr<Process>> twins_;  ///< from the finer to the coarser
  nlohmann::json saved_;                         ///< error, order, dimension of the last comparison; null before it
};

}  // namespace malleus
