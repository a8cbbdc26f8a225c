#pragma once

/// What the fluids do to the walls.

#include <array>
#include <vector>

#include "inject/scene.hpp"

namespace malleus::inject {

/// Shear stress on the walls [Pa], [node]: size of the tangential part of 2 eta eps(v) n in the elements at the wall,
/// mean over the facets at a node by area; 0 off the walls. From the fields velocity and viscosity. Collective.
std::vector<Real> wall_shear_stress(const Scene& scene);

/// Force [N] with which the fluids push the walls apart along each axis (what a clamp along it must hold): integral of
/// p n over the walls that face its positive direction. Pressure above zero alone. From the field pressure. Of the
/// modelled part, per metre of depth in plane scenes. Collective.
std::array<Real, 3> opening_force(const Scene& scene);

}  // namespace malleus::inject
