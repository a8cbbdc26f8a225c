#include "forge/initial_contact.hpp"

#include <fmt/format.h>

#include <limits>

#include "base/log.hpp"

namespace malleus::forge {
namespace {

constexpr Real none = std::numeric_limits<Real>::max();
/// Overlaps below this share of an edge come from rounding, of a size that no force shows.
constexpr Real harmless_overlap = 1e-4;
/// Gaps between bodies are looked for within this share of the scene's height: from afar a node meets the outer sides
/// of the other body from behind.
constexpr Real told_share = 0.25;
/// Overlaps of so many edges look like a tool that is turned the wrong way.
constexpr Real turned_overlap = 1;

/// The smallest gap of all ranks, with its node's place and edge; of equal ones that of the lowest rank.
Clearance smallest_of_all(const Scene& scene, const std::string& opponent, Real gap, LocalId node) {
  Clearance result;
  result.opponent = opponent;
  result.gap = scene.comm->min(gap);
  const GlobalId mine = gap == result.gap && node >= 0 ? scene.comm->rank() : scene.comm->size();
  const GlobalId speaker = scene.comm->min(mine);
  if (speaker == scene.comm->size()) return result;
  std::array<Real, 4> told = {0, 0, 0, 0};
  if (scene.comm->rank() == speaker) {
    std::copy_n(scene.mesh.point(node), scene.dim(), told.begin());
  }
  scene.comm->broadcast(std::span<Real>(told), static_cast<int>(speaker));
  std::copy_n(told.begin(), 3, result.place.begin());
  return result;
}

Clearance of_tool(Scene& scene, const FreeSurface& surface, Tool& tool) {
  tool.plan(scene.progress.time, euler_step(0));
  Real least = none;
  LocalId closest = -1;
  for (const LocalId node : surface.nodes()) {
    const auto body = static_cast<std::size_t>(surface.body_of_node(node));
    if (!scene.bodies[body].is_deformable()) continue;
    const Real distance = tool.distance_at_end(to_vector(scene.mesh.point(node), scene.dim()));
    if (distance < least) {
      least = distance;
      closest = node;
    }
  }
  return smallest_of_all(scene, "tool " + tool.name(), least, closest);
}

Clearance of_pair(Scene& scene, const FreeSurface& surface, const BodyPair& pair) {
  std::vector<Vector> positions;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    positions.push_back(to_vector(scene.mesh.point(node), scene.dim()));
  }
  Real least = none;
  LocalId closest = -1;
  for (const NodeFacetPair& met :
       find_pairs(*scene.comm, surface, positions, {pair.slave, pair.master, told_share * scene.scale.height})) {
    if (met.gap >= least) continue;
    least = met.gap;
    closest = met.slave;
  }
  return smallest_of_all(scene, "contact " + pair.name, least, closest);
}

}  // namespace

std::vector<Clearance> measure_clearances(Scene& scene) {
  const FreeSurface surface(*scene.comm, scene.mesh, scene.geometry, scene.boundaries->is_free());
  std::vector<Clearance> list;
  for (Tool& tool : scene.tools) list.push_back(of_tool(scene, surface, tool));
  for (const BodyPair& pair : scene.pairs) {
    list.push_back(of_pair(scene, surface, pair));
    list.back().edge = scene.body_scales[static_cast<std::size_t>(pair.slave)].edge;
  }
  Real edge = none;
  for (const BodyScale& body : scene.body_scales) {
    if (body.is_deformable && body.edge > 0) edge = std::min(edge, body.edge);
  }
  for (Clearance& clearance : list) clearance.edge = clearance.edge > 0 ? clearance.edge : edge;
  std::erase_if(list, [&](const Clearance& clearance) { return clearance.gap >= scene.scale.height; });
  return list;
}

std::vector<Swallowed> find_swallowed(Scene& scene, const std::vector<char>& may_be_open) {
  const Mesh& mesh = scene.mesh;
  std::vector<Swallowed> found;
  for (std::size_t t = 0; t < scene.tools.size(); ++t) {
    Tool& tool = scene.tools[t];
    tool.plan(scene.progress.time, euler_step(0));
    std::vector<Real> nearest(scene.bodies.size(), -none);
    std::vector<Real> deepest(scene.bodies.size(), none);
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto body = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
      if (nearest[body] > 0) continue;
      for (const LocalId node : mesh.nodes_of_element(e)) {
        const Real distance = tool.distance_at_end(to_vector(mesh.point(node), mesh.dim));
        nearest[body] = std::max(nearest[body], distance);
        deepest[body] = std::min(deepest[body], distance);
      }
    }
    for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
      const Real least = scene.comm->max(nearest[body]);
      const Real depth = -scene.comm->min(deepest[body]);
      const Real edge = scene.body_scales[body].edge;
      if (!scene.bodies[body].is_deformable() || least > harmless_overlap * edge || depth < 0.5 * edge) continue;
      if (may_be_open[t] != 0 && least < -edge) continue;
      found.push_back({t, scene.bodies[body].name, depth});
    }
  }
  return found;
}

void report_clearances(Scene& scene) {
  for (const Clearance& clearance : measure_clearances(scene)) {
    const Real share = -clearance.gap / clearance.edge;
    const std::string place =
        fmt::format("at ({:.4g}, {:.4g}, {:.4g}) m", clearance.place[0], clearance.place[1], clearance.place[2]);
    if (share <= harmless_overlap) {
      const bool touches = share >= -harmless_overlap;
      log::info("{}: {}", clearance.opponent,
                touches ? std::string("touches at the start")
                        : fmt::format("{:.3g} m away at the start, {}", clearance.gap, place));
      continue;
    }
    log::warn(
        fmt::format("{}: {:.3g} m of overlap at the start, {:.2g} edges, {}: the first increment pushes it out with a "
                    "force that the process does not have{}",
                    clearance.opponent, -clearance.gap, share, place,
                    share > turned_overlap ? "; is the tool's material or normal on the wrong side?" : ""));
  }
}

}  // namespace malleus::forge
