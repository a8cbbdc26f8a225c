#pragma once

/// Cases on a box for the tests of inject: polymer enters at x = 0 and air leaves at the other end.

#include "inject/scene.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus::test {

inline Mesh box(int dim, int along, int across) {
  return box_mesh(world(), {dim, {along, across, across}, {0, 0, 0}, {2, 1, 1}, 0.15});
}

/// Polymer 100 Pa.s, air 1 Pa.s; flow rate 1 m^3/s. sides: of the planes across the flow.
inline inject::InjectCase box_case(int dim, inject::WallSettings::Condition sides) {
  inject::InjectCase settings;
  for (const auto& [name, viscosity] : {std::pair("polymer", 100.0), std::pair("air", 1.0)}) {
    inject::FluidSettings& fluid = settings.fluids.emplace_back();
    fluid.name = name;
    fluid.viscosity = Expression(viscosity);
  }
  settings.initial.emplace().fluid = "air";
  inject::InletSettings& inlet = settings.inlets.emplace_back();
  inlet.name = "gate";
  inlet.group = "x_low";
  inlet.fluid = "polymer";
  inlet.flow_rate = Expression(1);
  inject::VentSettings& vent = settings.vents.emplace_back();
  vent.name = "outlet";
  vent.group = "x_high";
  for (const char* group : {"y_low", "y_high", "z_low", "z_high"}) {
    if (dim == 2 && group[0] == 'z') continue;
    inject::WallSettings& wall = settings.walls.emplace_back();
    wall.name = wall.group = group;
    wall.condition = sides;
  }
  return settings;
}

}  // namespace malleus::test
