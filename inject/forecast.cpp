#include "inject/forecast.hpp"

#include <algorithm>
#include <cmath>

#include "fem/level_set_volume.hpp"
#include "inject/flow_conditions.hpp"

namespace malleus::inject {
namespace {

// Seconds of one core a node, measured on the housing at draft and on the channel at standard.
constexpr Real of_a_solve_3d = 90e-6;
constexpr Real of_a_solve_2d = 9e-6;
constexpr Real of_a_substep_3d = 4e-6;
constexpr Real of_a_substep_2d = 0.6e-6;
constexpr Real newton_solves = 5;  ///< of a nonlinear flow
constexpr Real unreached = 1e300;
constexpr Real fastest_to_mean = 2;  ///< substeps follow the fastest fluid, the stride the front as a whole

Real length_of_edge(const Mesh& mesh, LocalId a, LocalId b) {
  Real square = 0;
  for (int c = 0; c < mesh.dim; ++c) square += std::pow(mesh.point(a)[c] - mesh.point(b)[c], 2);
  return std::sqrt(square);
}

/// What the gates are to do, where all have a given flow.
struct GateFlow {
  Real flow = 0;   ///< m^3/s
  Real speed = 0;  ///< m/s, of the fastest
};

std::optional<GateFlow> flow_of_gates(const Scene& scene) {
  GateFlow all;
  const std::vector<GateDrive> drives = asked_drives(scene, 0);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (drive.kind == GateDrive::Kind::pressure) return std::nullopt;
    all.flow += drive.value;
    all.speed = std::max(all.speed, drive.value / part->area);
  }
  if (!(all.flow > 0)) return std::nullopt;
  return all;
}

/// Elements that the front crosses: those on its way; with the speed of the gates for the whole filling it would be
/// more where the cavity is wider than they are. The truth lies between: the geometric mean.
Real elements_crossed(const Scene& scene, Real way) {
  Real elements = way / scene.element_size;
  const std::optional<GateFlow> gates = flow_of_gates(scene);
  if (!gates) return elements;
  const Real at_gate_speed = scene.cavity / gates->flow * gates->speed / scene.element_size;
  elements = std::sqrt(elements * std::max(elements, at_gate_speed));
  const auto& end = scene.settings.time.end;
  return end ? elements * std::min(1.0, *end * gates->flow / scene.cavity) : elements;
}

Real increments_of_the_front(const Scene& scene, Real way, Real stride) {
  const TimeSettings& time = scene.settings.time;
  Real count = elements_crossed(scene, way) / stride;
  if (time.end && time.step) count = std::max(count, *time.end / *time.step);
  if (time.increments) count = std::min(count, static_cast<Real>(*time.increments));
  return std::ceil(std::max(count, 1.0));
}

}  // namespace

/// Along the edges of the mesh: sweeps up and down the nodes' numbers, which follow a space-filling curve, until no
/// rank's distances become shorter.
Real way_of_fronts(const Scene& scene, const FrontSet& fronts) {
  if (fronts.size() == 0) return 0;
  const auto n = static_cast<std::size_t>(scene.mesh.nodes());
  std::vector<Real> way(n);
  for (std::size_t node = 0; node < n; ++node) {
    bool is_filled = false;
    for (std::size_t i = 0; i < fronts.size(); ++i) is_filled = is_filled || fronts.values(i)[node] >= 0;
    way[node] = is_filled ? 0 : unreached;
  }
  const auto shorten = [&](LocalId node) {
    Real& here = way[static_cast<std::size_t>(node)];
    for (const LocalId other : scene.graph.of(node)) {
      here = std::min(here, way[static_cast<std::size_t>(other)] + length_of_edge(scene.mesh, node, other));
    }
  };
  std::vector<Real> before;
  do {
    before = way;
    for (LocalId node = 0; node < scene.mesh.nodes(); ++node) shorten(node);
    for (LocalId node = scene.mesh.nodes() - 1; node >= 0; --node) shorten(node);
    scene.mesh.node_halo.min_to_owners(way, 1);
    scene.mesh.node_halo.update_copies(way, 1);
  } while (scene.comm.any(before != way));
  Real farthest = 0;
  for (const Real value : way) {
    if (value < unreached) farthest = std::max(farthest, value);
  }
  return scene.comm.max(farthest);
}

Forecast forecast_filling(const Scene& scene, Real way, Real stride, bool solves_flow, bool is_linear) {
  const InjectCase& settings = scene.settings;
  const auto nodes = static_cast<Real>(scene.mesh.total_nodes());
  const auto ranks = static_cast<Real>(scene.comm.size());
  const Real solves_each = is_linear ? 1 : newton_solves;
  const Real of_a_solve = scene.mesh.dim == 3 ? of_a_solve_3d : of_a_solve_2d;
  const Real of_a_substep = scene.mesh.dim == 3 ? of_a_substep_3d : of_a_substep_2d;
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
