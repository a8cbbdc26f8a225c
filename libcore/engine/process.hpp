#pragma once

/// What a simulator gives to the engine: a scene, the components that it needs, and how they end.

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/component.hpp"
#include "engine/error_budget.hpp"
#include "engine/probes.hpp"
#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// A piece of physics that the scene does without, and why.
struct LeftOut {
  std::string physics;  ///< "heat equation"
  std::string reason;   ///< "no [thermal] section"
};

/// Totals of the linear solver since the start of the run; times are this rank's.
struct LinearTotals {
  GlobalId solves = 0;
  GlobalId iterations = 0;
  GlobalId failures = 0;
  Real assembly_s = 0;
  Real setup_s = 0;
  Real solve_s = 0;
};

/// What a run is expected to take.
struct Forecast {
  Real wall_s = 0;
  Real memory_bytes = 0;  ///< over all ranks
  GlobalId increments = 0;
};

/// A cell of history.csv; empty where the quantity has no value.
using HistoryCell = std::optional<Real>;

/// A scene and its components, in the order in which they run each increment. Calls are collective unless said.
class Process {
 public:
  virtual ~Process() = default;

  virtual const Mesh& mesh() const = 0;
  virtual FieldStore& fields() = 0;
  virtual std::vector<Component*> components() = 0;
  virtual std::vector<LeftOut> left_out() const = 0;
  /// Models that the scene might do without, and what to write instead: lines of the plan.
  virtual std::vector<std::string> suggestions() const { return {}; }
  virtual std::vector<std::string> accuracy_settings()
      const = 0;  ///< lines of the plan: "newton_tolerance 1e-4 (level standard)"
  virtual Forecast forecast() const = 0;
  virtual std::vector<std::string> output_fields() const = 0;  ///< names of fields to write, where they exist

  /// The largest step that the physics allows from here [s]; infinite where nothing limits it.
  virtual Real largest_step() = 0;
  /// Why the run is over after the increments so far, if it is: "stroke reached", "cavity full".
  virtual std::optional<std::string> finished() = 0;
  /// How much of the way to that end is done, 0..1; 0 where nothing tells. For the time left in the log.
  virtual Real progress() { return 0; }
  /// Brings fields that are only looked at (quality) up to date before probes and outputs record them.
  virtual void refresh_outputs() {}

  /// @name history.csv, beyond the columns of the engine: same on all ranks
  /// @{
  virtual std::vector<std::string> history_columns() const = 0;
  virtual std::vector<HistoryCell> history_row() = 0;
  virtual Real volume() const = 0;  ///< m^3 of the mesh now (of the whole revolution; per metre in plane scenes)
  /// @}

  /// The probes of the scene; null where it has none. The engine records them and keeps their places in checkpoints.
  virtual Probes* probes() { return nullptr; }

  virtual std::string increment_note() const = 0;  ///< the process' part of the log line of an increment
  virtual LinearTotals linear_totals() const = 0;
  virtual nlohmann::json accuracy() = 0;                           ///< object `accuracy` of summary.json
  virtual std::vector<std::string> closing_lines() { return {}; }  ///< before the error budget at the end of the log
  /// The main results of the last increment, by whose change with the mesh the error of space is judged: all of one
  /// unit, in a fixed order; empty where a scene has none. The same on all ranks. Collective.
  virtual std::vector<Real> results() { return {}; }
  /// Before an increment whose results() will be compared: all of it is solved anew, nothing kept from earlier ones.
  virtual void solve_all_next() {}
  /// On a mesh made anew, ahead of an increment that is compared with that of another mesh: what steps give back
  /// (volume lost before, gaps of surfaces that touch) belongs to the other mesh, and is left out from now on.
  /// size_ratio: its sizes over those of the other mesh; what goes with sizes but is no error of space stays as it is
  /// there.
  virtual void stand_as_it_is(Real /*size_ratio*/) {}
  /// Whether results() change in the course of the run beyond what the first increment tells of the mesh.
  virtual bool solves_again() const { return true; }
  /// Whether a mesh of half the sizes takes twice as many increments.
  virtual bool steps_follow_sizes() const { return false; }
  /// Sources of error that the process can tell at the end of a run, each once; the engine adds that of space.
  virtual ErrorBudget error_budget() { return {}; }

  /// @name Checkpoints: what is not in mesh and fields. Numbers survive bit for bit.
  /// @{
  virtual nlohmann::json save_state() const = 0;  ///< same on all ranks
  /// What this rank alone knows besides, by local numbers: given back on as many ranks as saved it, to go on with the
  /// same digits. Elsewhere the process does without. Local.
  virtual std::vector<Real> save_local() const { return {}; }
  virtual void restore_local(std::span<const Real> /*saved*/) {}
  /// Mesh and fields in place of the present ones, and the state saved with them.
  virtual void restore(Mesh&& mesh, std::vector<std::pair<FieldSpec, std::vector<Real>>>&& fields,
                       const nlohmann::json& state) = 0;
  /// @}
};

}  // namespace malleus
