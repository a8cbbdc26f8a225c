#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/simpler_geometry.hpp"
#include "forge/forge_process.hpp"

namespace malleus::forge {
namespace {

/// A body so many times as stiff as the softest deforms by less than what meshes leave.
constexpr Real as_good_as_rigid = 50;
/// Weight below this share of the flow stress changes forces and shapes by less than other errors.
constexpr Real as_good_as_weightless = 1e-3;

/// Distance to the nearest face of a tool where it stands, m.
Real distance_to(const Tool& tool, const Position& place) {
  std::vector<SurfaceContact> faces;
  tool.contacts_at_start(to_vector(place.data(), 3), std::numeric_limits<Real>::infinity(), faces);
  Real distance = std::numeric_limits<Real>::infinity();
  for (const SurfaceContact& face : faces) distance = std::min(distance, face.distance);
  return distance;
}

/// None where tools turn or states come from elsewhere.
std::optional<SceneParts> parts_of(const Scene& scene, const ForgeCase& forge_case) {
  if (forge_case.initial && !forge_case.initial->from.empty()) return std::nullopt;
  for (const BodySettings& body : forge_case.bodies) {
    if (body.temperature && body.temperature->depends_on_position()) return std::nullopt;
  }
  std::optional<SceneParts> parts = parts_of_common_sections(scene.mesh, forge_case.common);
  if (!parts) return std::nullopt;
  for (const Tool& tool : scene.tools) {
    const ToolMotion& motion = tool.motion();
    if (motion.rotation.squaredNorm() > 0) return std::nullopt;
    parts->vectors.push_back({motion.direction[0], motion.direction[1], motion.direction[2]});
    parts->scalars.emplace_back([&tool](const Position& place) { return distance_to(tool, place); });
  }
  return parts;
}

}  // namespace

std::vector<std::string> ForgeProcess::suggestions() const {
  Real softest = std::numeric_limits<Real>::infinity();
  Real weight = 0;  // Pa
  Real stress = std::numeric_limits<Real>::infinity();
  const auto& gravity = case_.common.gravity;
  for (const Body& body : scene_->bodies) {
    if (!body.is_deformable() || body.name.empty()) continue;
    softest = std::min(softest, body.consistency);
    stress = std::min(stress, body.consistency * std::pow(std::sqrt(3.0) * scene_->scale.rate(), body.sensitivity));
    if (gravity) {
      const Vector down = to_vector(gravity->acceleration.data(), 3);
      weight = std::max(weight, body.density * down.norm() * scene_->scale.height);
    }
  }
  std::vector<std::string> lines;
  for (const Body& body : scene_->bodies) {
    if (!body.is_deformable() || body.consistency < as_good_as_rigid * softest) continue;
    lines.push_back(
        fmt::format("deformation of {}: it is {:.3g} times as stiff as the softest body; [body.{}] law = rigid",
                    body.name, body.consistency / softest, body.name));
  }
  if (weight > 0 && weight < as_good_as_weightless * stress) {
    lines.push_back(fmt::format("weight: {:.2g} Pa beside a flow stress of {:.2g} Pa; no [gravity]", weight, stress));
  }
  if (const auto parts = parts_of(*scene_, case_)) {
    const auto simpler = find_simpler_geometry(*scene_->comm, scene_->mesh, scene_->geometry, *parts);
    for (std::string& line : simpler.suggestions("[boundary.NAME] type = symmetry")) lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace malleus::forge
