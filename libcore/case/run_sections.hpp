#pragma once

/// Sections of both programs that say how to run: files, time, accuracy, solvers, output and limits.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "case/schema.hpp"

namespace malleus {

/// What a mesh of two dimensions stands for; a mesh of three is always Cartesian.
enum class CaseGeometry { cartesian, axisymmetric };

/// [case]
struct CaseSettings {
  std::string name;  ///< of the output files; who reads sets the case file's stem before, as the default
  std::string title;
  CaseGeometry geometry = CaseGeometry::cartesian;

  void describe(Section& s);
  void validate(Section& s) const;
};

/// [mesh]
struct MeshSettings {
  std::filesystem::path file;
  std::string length_unit = "m";

  void describe(Section& s);
  Real length_scale() const;  ///< m per length unit of the mesh file
};

/// [time]. The run ends at the first limit that is given. forge adds `stroke` (derive, and call this describe()).
struct TimeSettings {
  std::optional<Real> end;   ///< s
  std::optional<Real> step;  ///< s, the largest increment
  std::optional<int> increments;

  void describe(Section& s);
};

/// [accuracy]
struct AccuracySettings {
  Level level = Level::standard;
  bool two_meshes = true;
  Real size_factor = 1;              ///< of the mesh file's sizes
  std::optional<Real> target_error;  ///< relative
  std::optional<Real> target_time;   ///< s

  bool has_targets() const { return target_error || target_time; }

  void describe(Section& s);
};

/// How the linearised system is solved.
enum class LinearChoice { block_triangular, gmres_ilu, conjugate_residual };

/// [solver]
struct SolverSettings {
  Real newton_tolerance = 0;  ///< on the relative nonlinear residual
  Real linear_tolerance = 0;  ///< on the true ||b - Ax|| / ||b||
  int max_newton = 30;
  Real cutoff_strain_rate = 0;  ///< below it a power law is Newtonian; in units of V/H, speed over height of the scene
  LinearChoice linear_method = LinearChoice::block_triangular;

  void describe(Section& s);
};

/// [remesh]: absent, the mesh keeps its topology.
struct RemeshSettings {
  bool active = true;
  std::optional<Real> size;       ///< m; none: the input's local size
  std::optional<Real> min_size;   ///< m
  std::optional<Real> max_size;   ///< m
  std::optional<GlobalId> nodes;  ///< target count
  std::optional<Real> error;      ///< target of the estimated relative error
  Real gradation = 1.3;           ///< largest ratio of sizes of neighbouring edges
  std::optional<int> every;       ///< increments; none: when quality or contact asks
  bool anisotropic = false;

  void describe(Section& s);
  void validate(Section& s) const;
};

enum class Precision { float32, float64 };

/// [output]
struct OutputSettings {
  std::filesystem::path directory;  ///< empty: the program chooses
  int every = 1;                    ///< increments
  std::vector<std::string> fields;  ///< empty: all that the scene has
  Precision precision = Precision::float32;

  void describe(Section& s);
};

/// An interval in increments or in seconds of wall time: one of the two has a value.
struct Interval {
  std::optional<GlobalId> increments;
  std::optional<Real> seconds;
};

/// [checkpoint]
struct CheckpointSettings {
  Interval every = {std::nullopt, 600};

  void describe(Section& s);
};

/// [limits]
struct LimitSettings {
  std::optional<Real> wall_time;  ///< s
  std::optional<Real> memory;     ///< bytes, summed over ranks

  void describe(Section& s);
};

enum class PartitionMethod { curve, scotch, cost };
enum class Balance { counted, measured };

/// [partition]
struct PartitionSettings {
  PartitionMethod method = PartitionMethod::curve;
  Balance balance = Balance::counted;

  void describe(Section& s);
};

}  // namespace malleus
