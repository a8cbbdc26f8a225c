#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/simpler_geometry.hpp"
#include "inject/flow_conditions.hpp"
#include "inject/process.hpp"

namespace malleus::inject {
namespace {

/// Inertia changes pressures by some hundredths of the Reynolds number.
constexpr Real creeping = 0.1;

/// m^2/s: speed at a gate of given flow times its width, the largest; 0 where gates have pressures.
Real speed_times_width(const Scene& scene) {
  Real largest = 0;
  const std::vector<GateDrive> drives = asked_drives(scene, 0);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (drive.kind == GateDrive::Kind::pressure || !(part->area > 0)) continue;
    const Real width = scene.mesh.dim == 3 ? std::sqrt(part->area) : part->area;
    largest = std::max(largest, std::abs(drive.value) / part->area * width);
  }
  return largest;
}

/// Air this much thinner than what pushes it has pressures below other errors.
constexpr Real as_good_as_void = 1e-3;

bool comes_in(const InjectCase& settings, const FluidSettings& fluid) {
  return std::ranges::any_of(settings.inlets, [&](const auto& gate) { return gate.fluid == fluid.name; });
}

std::optional<std::string> inertia_to_leave_out(const Scene& scene) {
  if (!scene.settings.common.inertia) return std::nullopt;
  Real reynolds = 0;
  for (const FluidSettings& fluid : scene.settings.fluids) {
    if (!comes_in(scene.settings, fluid) || fluid.law == FluidSettings::Law::empty) continue;
    reynolds = std::max(reynolds, fluid.density.value_or(0) * speed_times_width(scene) / fluid.reference_viscosity());
  }
  if (!(reynolds > 0) || reynolds > creeping) return std::nullopt;
  return fmt::format("inertia: the Reynolds number at the gates is about {:.2g}; no [inertia]", reynolds);
}

/// A thin fluid that fills the cavity at the start and only leaves it.
std::optional<std::string> fluid_to_leave_out(const InjectCase& settings) {
  if (settings.fluids.size() != 2 || settings.vents.empty() || settings.initial_fluid() < 0) return std::nullopt;
  if (settings.front.transport == FrontSettings::Transport::trace || settings.common.inertia) return std::nullopt;
  const auto air = static_cast<std::size_t>(settings.initial_fluid());
  const FluidSettings& thin = settings.fluids[air];
  const FluidSettings& other = settings.fluids[1 - air];
  if (comes_in(settings, thin) || thin.law == FluidSettings::Law::empty) return std::nullopt;
  const Real ratio = thin.reference_viscosity() / other.reference_viscosity();
  if (!(ratio <= as_good_as_void)) return std::nullopt;
  return fmt::format("flow of {}: it is {:.2g} times as viscous as {}; [fluid.{}] law = void", thin.name, ratio,
                     other.name, thin.name);
}

bool are_alike(const FluidSettings& one, const FluidSettings& other) {
  return one.law == FluidSettings::Law::newtonian && other.law == FluidSettings::Law::newtonian &&
         one.viscosity->is_constant() && other.viscosity->is_constant() &&
         one.reference_viscosity() == other.reference_viscosity();
}

/// Solves of the flow after the first, where it stays as it is while the front moves.
std::optional<std::string> solves_to_leave_out(const InjectCase& settings) {
  if (settings.fluids.size() < 2 || settings.flow.update.kind == FlowUpdate::Kind::once) return std::nullopt;
  if (settings.common.inertia || settings.common.gravity || settings.common.body_force) return std::nullopt;
  const bool is_steady = std::ranges::none_of(
      settings.inlets, [](const InletSettings& gate) { return gate.depends_on_time() || gate.switches(); });
  const bool is_alike =
      std::ranges::all_of(settings.fluids, [&](const auto& fluid) { return are_alike(fluid, settings.fluids[0]); });
  if (!is_steady || !is_alike) return std::nullopt;
  return "solving the flow again: all fluids are alike, it stays as it is; [flow] update = once";
}

/// None where anything depends on the position, or the flow is prescribed.
std::optional<SceneParts> parts_of(const Scene& scene) {
  const InjectCase& settings = scene.settings;
  if (settings.flow.is_prescribed() || (settings.initial && !settings.initial->from.empty())) return std::nullopt;
  std::optional<SceneParts> parts = parts_of_common_sections(scene.mesh, settings.common);
  if (!parts) return std::nullopt;
  const auto varies = [](const std::optional<Expression>& formula) {
    return formula && formula->depends_on_position();
  };
  for (const FluidSettings& fluid : settings.fluids) {
    if (varies(fluid.viscosity)) return std::nullopt;
  }
  for (const BoundaryPart& part : scene.parts) {
    if (part.kind == BoundaryPart::Kind::imposed) continue;
    const bool is_plain_wall = part.kind == BoundaryPart::Kind::wall &&
                               settings.walls[part.index].condition == WallSettings::Condition::no_slip &&
                               settings.walls[part.index].only.empty();
    if (!is_plain_wall) parts->add_class(part.group, part.kind == BoundaryPart::Kind::symmetry);
  }
  for (const InletSettings& gate : settings.inlets) {
    if (varies(gate.flow_rate) || varies(gate.pressure)) return std::nullopt;
    if (gate.velocity && (varies(gate.velocity->speed) || !parts->add_vector(gate.velocity->vector)))
      return std::nullopt;
    if (!parts->add_vector(gate.velocity_components)) return std::nullopt;
  }
  if (std::ranges::any_of(settings.vents, [&](const auto& vent) { return varies(vent.pressure); })) return std::nullopt;
  for (const InitialShape& shape : settings.shapes) {
    parts->scalars.emplace_back(
        [&shape, dim = scene.mesh.dim](const Position& place) { return shape.signed_distance(place, dim); });
  }
  return parts;
}

}  // namespace

std::vector<std::string> FillingProcess::suggestions() const {
  const InjectCase& settings = scene_.settings;
  std::vector<std::string> lines;
  if (flow_) {
    for (auto& line : {inertia_to_leave_out(scene_), fluid_to_leave_out(settings), solves_to_leave_out(settings)}) {
      if (line) lines.push_back(*line);
    }
  }
  if (const auto parts = parts_of(scene_)) {
    const auto simpler = find_simpler_geometry(scene_.comm, scene_.mesh, scene_.geometry, *parts);
    for (std::string& line : simpler.suggestions("[symmetry.NAME]")) lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace malleus::inject
