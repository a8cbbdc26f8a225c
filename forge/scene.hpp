#pragma once

/// What the components of a forging process share.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "field/field.hpp"
#include "forge/boundaries.hpp"
#include "forge/contact_search.hpp"
#include "forge/forge_case.hpp"
#include "forge/thermal_scene.hpp"

namespace malleus::forge {

/// A region of the mesh with its law.
struct Body {
  std::string name;
  BodyLaw law = BodyLaw::norton_hoff;
  Real consistency = 0;   ///< K, Pa.s^m; capped where it is a die's, see cap_die_viscosity()
  Real sensitivity = 1;   ///< m
  Real density = 0;       ///< kg/m^3
  Real start_volume = 0;  ///< m^3, of the whole run
  Real volume = 0;        ///< m^3, now

  bool is_deformable() const noexcept { return law != BodyLaw::rigid; }
};

/// What makes numbers of the scene comparable: a speed, a length, a rate.
struct ReferenceScale {
  Real speed = 0;   ///< V: of the fastest tool or boundary, m/s; without any, a rate from the loads times the height
  Real height = 0;  ///< H: extent of the deformable bodies along that motion, m
  Real rate() const { return speed / height; }  ///< 1/s
};

/// How far along the run is, beside mesh and fields: what a checkpoint keeps.
struct Progress {
  Real time = 0;              ///< s
  Real last_step = 0;         ///< s; 0 = the next increment starts the time scheme anew
  Real raw_volume_drift = 0;  ///< relative, summed over the steps: what the motion alone lost, without the target
  bool was_pushed = false;    ///< something acted on the bodies in the last increment
  std::vector<Real> boundary_strokes;  ///< [boundary] m
  std::vector<Real> body_strokes;      ///< [region] m
  std::vector<Real> volume_targets;    ///< [region] div v asked for in the last increment, 1/s
  std::vector<Real> asked_strains;     ///< [region] volume strain asked for in the last increment
  std::vector<Real> volume_losses;     ///< [region] volume strain of the last increment less what was asked
};

/// The mesh stays at its place in memory through the run.
struct Scene {
  const Communicator* comm = nullptr;
  Mesh mesh;
  FieldStore fields;
  Geometry geometry = Geometry::plane;
  std::vector<Body> bodies;  ///< [region]
  std::vector<Tool> tools;
  std::vector<BodyPair> pairs;
  std::vector<BodyScale> body_scales;  ///< [region]
  std::unique_ptr<Boundaries> boundaries;
  std::unique_ptr<const ViscosityModel> viscosity;
  std::optional<ThermalScene> thermal;  ///< where the case models heat
  ContactSettings contact;
  PenaltySettings penalty;
  MotionSettings motion;
  SolverSettings solver;
  ReferenceScale scale;
  Progress progress;

  /// What the flow tells the motion of an increment: displacements over the step [local node][dim], m/s, and strains
  /// over it [element], 1/s.
  std::vector<Real> step_velocity;
  std::vector<Real> step_strain_rate;

  int dim() const noexcept { return mesh.dim; }
  Real deformable_volume() const;  ///< m^3, now
};

/// Names of the fields that the process keeps.
namespace field_name {
inline constexpr const char* velocity = "velocity";
inline constexpr const char* pressure = "pressure";
inline constexpr const char* viscosity = "viscosity";
inline constexpr const char* strain_rate = "strain_rate";
inline constexpr const char* equivalent_strain = "equivalent_strain";
inline constexpr const char* stress = "stress";
inline constexpr const char* contact_pressure = "contact_pressure";
inline constexpr const char* contact_gap = "contact_gap";
inline constexpr const char* quality = "quality";
inline constexpr const char* temperature = "temperature";
}  // namespace field_name

/// Declares the fields that every forging scene has.
void declare_fields(Scene& scene);

/// Volumes of the bodies [region], m^3 (of the whole revolution; m^2 in plane strain). Collective.
std::vector<Real> body_volumes(const Scene& scene);

/// Whether an element of the mesh has no positive volume. Collective.
bool has_turned_elements(const Scene& scene);

/// A case on its mesh: bodies, tools, contacts, scales. The mesh's groups are those of the case. InputError where
/// elements belong to no body. Collective.
void build_scene(const Communicator& comm, Mesh mesh, const ForgeCase& forge_case, Scene& scene);

/// Which of two bodies is the master: the stiffer (consistency, at equal ones the larger viscosity at the reference
/// rate), of equally stiff ones that with the coarser surface. Paper, 2.1.2.
bool is_better_master(const BodyScale& one, const BodyScale& two);

}  // namespace malleus::forge
