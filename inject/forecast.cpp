#include "inject/forecast.hpp"

#include <algorithm>
#include <cmath>

#include "fem/level_set_volume.hpp"
#include "inject/flow_conditions.hpp"

namespace malleus::inject {
namespace {

// Seconds of one core a node, measured on the housing at draft and on the channel at standard.
constexpr Real of_a_solve = 90e-6;
constexpr Real of_a_substep = 4e-6;
constexpr Real newton_solves = 5;    ///< of a nonlinear flow
constexpr Real fastest_to_mean = 2;  ///< substeps follow the fastest fluid, the stride the front as a whole

/// The share of the cavity that comes in until [time] end; 1 where gates of given pressure do not tell.
Real share_filled(const Scene& scene) {
  const auto& end = scene.settings.time.end;
  if (!end) return 1;
  Real flow = 0;
  for (const GateDrive& drive : asked_drives(scene, 0)) {
    if (drive.kind == GateDrive::Kind::pressure) return 1;
    flow += drive.value;
  }
  return flow > 0 ? std::min(1.0, *end * flow / scene.cavity) : 1;
}

Real increments_of_the_front(const Scene& scene, Real way, Real stride) {
  const TimeSettings& time = scene.settings.time;
  Real count = share_filled(scene) * way / (stride * scene.element_size);
  if (time.end && time.step) count = std::max(count, *time.end / *time.step);
  if (time.increments) count = std::min(count, static_cast<Real>(*time.increments));
  return std::ceil(std::max(count, 1.0));
}

}  // namespace

Real way_of_fronts(const Scene& scene, FrontSet& fronts) {
  fronts.set_initial();
  Real farthest = 0;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    Real nearest = 1e300;
    for (std::size_t i = 0; i < fronts.size(); ++i) {
      nearest = std::min(nearest, -fronts.values(i)[static_cast<std::size_t>(node)]);
    }
    if (fronts.size() > 0) farthest = std::max(farthest, nearest);
  }
  return scene.comm.max(farthest);
}

Forecast forecast_filling(const Scene& scene, Real way, Real stride, bool solves_flow, bool is_linear) {
  const InjectCase& settings = scene.settings;
  const auto nodes = static_cast<Real>(scene.mesh.total_nodes());
  const auto ranks = static_cast<Real>(scene.comm.size());
  const Real solves_each = is_linear ? 1 : newton_solves;
  Forecast forecast;
  forecast.memory_bytes = 60e6 * ranks + nodes * (solves_flow ? 7000 : 1500);
  forecast.wall_s = solves_flow ? of_a_solve * solves_each * nodes / ranks : 0;
  if (!(way > 0) || settings.time.increments == 0) return forecast;
  const Real increments = increments_of_the_front(scene, way, stride);
  const FlowUpdate& update = settings.flow.update;
  Real solves = solves_flow ? increments : 0;
  if (update.kind == FlowUpdate::Kind::once) solves = std::min(solves, 1.0);
  if (update.kind == FlowUpdate::Kind::every) solves /= update.every;
  const Real substeps = increments * std::max(1.0, fastest_to_mean * stride / settings.front.cfl);
  forecast.increments = static_cast<GlobalId>(increments);
  forecast.wall_s = nodes / ranks * (of_a_solve * solves_each * solves + of_a_substep * substeps);
  return forecast;
}

}  // namespace malleus::inject
