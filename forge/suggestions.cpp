#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "forge/forge_process.hpp"

namespace malleus::forge {
namespace {

/// A body so many times as stiff as the softest deforms by less than what meshes leave.
constexpr Real as_good_as_rigid = 50;
/// Weight below this share of the flow stress changes forces and shapes by less than other errors.
constexpr Real as_good_as_weightless = 1e-3;

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
  return lines;
}

}  // namespace malleus::forge
