#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

}  // namespace

std::vector<std::string> FillingProcess::suggestions() const {
  const InjectCase& settings = scene_.settings;
  if (!settings.common.inertia || !flow_) return {};
  Real reynolds = 0;
  for (const FluidSettings& fluid : settings.fluids) {
    const bool comes_in =
        std::ranges::any_of(settings.inlets, [&](const auto& gate) { return gate.fluid == fluid.name; });
    if (!comes_in || fluid.law == FluidSettings::Law::empty) continue;
    reynolds = std::max(reynolds, fluid.density.value_or(0) * speed_times_width(scene_) / fluid.reference_viscosity());
  }
  if (!(reynolds > 0) || reynolds > creeping) return {};
  return {fmt::format("inertia: the Reynolds number at the gates is about {:.2g}; no [inertia]", reynolds)};
}

}  // namespace malleus::inject
