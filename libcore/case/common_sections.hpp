#pragma once

/// The sections that forge and inject share, in one struct. Sections that one program extends ([time] with `stroke`,
/// [initial] with `fluid`) are bound by it: derive from TimeSettings or InitialSettings.

#include <optional>
#include <vector>

#include "case/run_sections.hpp"
#include "case/scene_sections.hpp"

namespace malleus {

struct CommonSections {
  CaseSettings case_settings;
  MeshSettings mesh;
  AccuracySettings accuracy;
  SolverSettings solver;
  std::optional<RemeshSettings> remesh;
  OutputSettings output;
  CheckpointSettings checkpoint;
  LimitSettings limits;
  PartitionSettings partition;
  std::vector<BoundarySettings> boundaries;
  std::optional<GravitySettings> gravity;
  std::optional<InertiaSettings> inertia;
  std::optional<ThermalSettings> thermal;
  std::optional<AirSettings> air;
  std::optional<BodyForceSettings> body_force;
  std::optional<ReferenceSettings> reference;
  std::vector<ProbeSettings> probes;

  /// [case], [mesh], [accuracy]: what a case file starts with.
  void describe_start(CaseReader& reader);
  /// [boundary.NAME] to [probe.NAME]: what is modelled beside the program's own sections.
  void describe_scene(CaseReader& reader);
  /// [solver] to [partition]: how it is run.
  void describe_run(CaseReader& reader);
  /// Boundaries give temperatures and heat only where heat is modelled: mistakes at those that do without. Local.
  void refuse_heat_without_thermal(CaseReader& reader) const;
};

}  // namespace malleus
