#pragma once

/// Signed distances of simple shapes: positive inside, negative outside [m].

#include "base/position.hpp"

namespace malleus {

struct Sphere {
  Position center = {0, 0, 0};
  Real radius = 1;
};
/// Axis-aligned, around its center; size = full edge lengths. In 2D the third size is ignored (dim = 2).
struct AxisBox {
  Position center = {0, 0, 0};
  Position size = {1, 1, 1};
  int dim = 3;
};
/// Inside is the side from which the normal points away; the normal need not have unit length but some.
struct HalfSpace {
  Position point = {0, 0, 0};
  Position normal = {1, 0, 0};
};

Real signed_distance(const Sphere& sphere, const Position& at);
Real signed_distance(const AxisBox& box, const Position& at);
Real signed_distance(const HalfSpace& half_space, const Position& at);

}  // namespace malleus
