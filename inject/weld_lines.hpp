#pragma once

/// Where fronts met.

#include <span>
#include <vector>

#include "inject/scene.hpp"

namespace malleus::inject {

/// Angle [degrees] between the directions from which fronts came to each node: 180 where they met head-on, 0 where one
/// front passed; [node]. With g the unit gradients of the fill time in the filled elements around a node and R the
/// length of their mean weighted by volume, two fronts of equal parts give R = cos(angle / 2). Nodes from which the
/// front moved apart, and angles below 30 degrees, which bent fronts have as well, are 0. fill_time: [node] s, < 0
/// where not filled. Collective.
std::vector<Real> weld_angle(const Scene& scene, std::span<const Real> fill_time);

}  // namespace malleus::inject
