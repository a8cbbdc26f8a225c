#pragma once

/// Points at which fields are recorded: probe-NAME.csv.

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "case/scene_sections.hpp"
#include "engine/component.hpp"
#include "field/field.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// The probes of a case. Rows: time_s, point, x, y, z, then the components of the fields; a point that lies outside the
/// mesh has empty cells. Every call is collective.
class Probes {
 public:
  /// Reads the files of points. InputError.
  Probes(const Communicator& comm, const Mesh& mesh, const std::vector<ProbeSettings>& settings);

  bool empty() const noexcept { return probes_.empty(); }
  bool any_moves() const;  ///< whether some points go with the material
  /// Writes the headers; the columns follow from the fields that exist now.
  void start_anew(const std::filesystem::path& directory, const FieldStore& fields);
  /// Keeps the rows up to a time, and goes on.
  void resume(const std::filesystem::path& directory, const FieldStore& fields, Real time);
  /// Appends the values at a time [s].
  void record(Real time, const Mesh& mesh, const FieldStore& fields);
  /// Moves the points that go with the material by the `velocity` field over dt [s] (midpoint rule). Call it before
  /// the mesh itself moves.
  void move(Real dt, const Mesh& mesh, const FieldStore& fields);

  /// Places of all points, for checkpoints; the same on all ranks.
  std::vector<std::vector<Real>> places() const;
  void set_places(const std::vector<std::vector<Real>>& places);

 private:
  struct Probe {
    ProbeSettings settings;
    std::vector<Real> points;  ///< [n][dim], m
  };
  std::vector<const Field*> fields_of(const Probe& probe, const FieldStore& fields) const;
  std::filesystem::path file_of(const Probe& probe) const;
  std::string header(const Probe& probe, const FieldStore& fields) const;

  const Communicator& comm_;
  int dim_ = 3;
  std::filesystem::path directory_;
  void warn_of_points_outside(const Probe& probe, const std::vector<char>& found);

  std::vector<Probe> probes_;
  std::set<std::string> warned_of_;  ///< probes with points outside
};

/// Carries the points that go with the material. Stands after the flow and before the motion of the mesh.
class TracerMotion : public Component {
 public:
  TracerMotion(Probes& probes, const Mesh& mesh, const FieldStore& fields)
      : probes_(probes), mesh_(mesh), fields_(fields) {}
  std::string name() const override { return "tracers"; }
  std::string purpose() const override { return "points that go with the material"; }
  FieldUse uses() const override { return {{"velocity"}, {}, {}}; }
  Outcome advance(const Increment& increment) override;
  void roll_back() override { probes_.set_places(before_); }

 private:
  Probes& probes_;
  const Mesh& mesh_;
  const FieldStore& fields_;
  std::vector<std::vector<Real>> before_;
};

}  // namespace malleus
