#include "forge/push_out.hpp"

#include <algorithm>

#include "base/log.hpp"

namespace malleus::forge {
namespace {

/// Depths below this share of an edge are what penalties leave.
constexpr Real usual_depth = 2e-5;
/// Deeper nodes than this share are not the remesh's doing.
constexpr Real largest_depth = 0.2;
constexpr int most_passes = 4;  ///< where several tools meet

Vector way_out(const std::vector<Tool>& tools, const Vector& point, Real edge) {
  Vector way = Vector::Zero();
  std::vector<SurfaceContact> found;
  for (int pass = 0; pass < most_passes; ++pass) {
    SurfaceContact deepest;
    for (const Tool& tool : tools) {
      found.clear();
      tool.contacts_at_end(point + way, largest_depth * edge, found);
      for (const SurfaceContact& contact : found) {
        if (contact.distance < deepest.distance) deepest = contact;
      }
    }
    const Real depth = -deepest.distance;
    if (depth <= usual_depth * edge || depth > largest_depth * edge) break;
    way += depth * deepest.normal;
  }
  return way;
}

}  // namespace

void push_out_of_tools(Scene& scene) {
  if (scene.tools.empty()) return;
  for (Tool& tool : scene.tools) tool.plan(scene.progress.time, euler_step(0));
  const FreeSurface surface(*scene.comm, scene.mesh, scene.geometry, scene.boundaries->is_free());
  const NodeConstraints constraints = scene.boundaries->constraints(scene.progress.time);
  const std::vector<Real> before = scene.mesh.coordinates;
  const auto dim = static_cast<std::size_t>(scene.dim());
  Real deepest = 0;
  for (const LocalId node : surface.nodes()) {
    const auto body = static_cast<std::size_t>(surface.body_of_node(node));
    if (!scene.bodies[body].is_deformable()) continue;
    const Real edge = scene.body_scales[body].edge;
    Vector way = way_out(scene.tools, to_vector(scene.mesh.point(node), scene.dim()), edge);
    constraints.project(node, way.data());
    deepest = std::max(deepest, way.norm() / edge);
    for (std::size_t c = 0; c < dim; ++c) {
      scene.mesh.coordinates[static_cast<std::size_t>(node) * dim + c] += way[static_cast<Eigen::Index>(c)];
    }
  }
  scene.mesh.node_halo.update_copies(std::span<Real>(scene.mesh.coordinates), scene.dim());
  if (has_turned_elements(scene)) {
    scene.mesh.coordinates = before;
  } else if (scene.comm->max(deepest) > 0) {
    log::debug("  nodes that the remesh left in tools, up to {:.2g} edges deep, were put onto them", deepest);
  }
}

}  // namespace malleus::forge
