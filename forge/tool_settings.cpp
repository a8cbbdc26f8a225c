#include <algorithm>

#include "forge/forge_case.hpp"

#include "base/error.hpp"
#include "base/units.hpp"

namespace malleus::forge {

Real ToolSettings::surface_scale() const {
  return convert_to_si(1, length_unit, parse_unit("m")).value;
}

void ToolSettings::describe(Section& s) {
  describe_shape(s);
  describe_motion(s);
  friction.describe(s);
  s.real("temperature", temperature, "K", "of the tool, which keeps it, with [thermal]")
      .above(0)
      .default_is("[thermal] ambient where heat_transfer is given; else no heat crosses");
  s.real("heat_transfer", heat_transfer, "W/m^2/K", "to bodies that touch the tool, with [thermal]")
      .at_least(0)
      .default_is("10 kW/m^2/K where temperature is given");
}

void ToolSettings::describe_shape(Section& s) {
  s.choice("shape", shape,
           {{"plane", ShapeKind::plane},
            {"sphere", ShapeKind::sphere},
            {"cylinder", ShapeKind::cylinder},
            {"box", ShapeKind::box},
            {"surface", ShapeKind::surface}},
           "of the rigid tool");
  s.choice(
      "material", side, {{"outside", Side::outside}, {"inside", Side::inside}},
      "where the material is: around a punch, within a container (not for planes); of an open surface, outside is the "
      "side of its normals (in 2D on the right of the lines' direction)");
  s.vector("point", point, "m", "a point of the plane; the centre of a sphere, a box, a cylinder; shift of a surface")
      .starter("0 0 10 mm");
  s.vector("normal", normal, "", "of a plane, out of the tool toward the material").starter("0 0 -1");
  s.vector("axis", axis, "", "of a cylinder; in 2D without it the cylinder is a disc");
  s.real("radius", radius, "m", "of a sphere or cylinder").above(0);
  s.real("length", length, "m", "of a cylinder with flat ends, centred at `point`").above(0).default_is("infinite");
  s.vector("size", size, "m", "edge lengths of a box; 0 = unlimited").at_least(0);
  s.path("file", file,
         "surface: STL, ASCII or binary (3D), or a gmsh mesh (.msh), of which the triangles count, in 2D the lines")
      .existing_file();
  s.string("length_unit", length_unit, "unit of the coordinates in the surface file");
}

void ToolSettings::describe_motion(Section& s) {
  s.vector("velocity", velocity, "m/s",
           "of the tool; of a hydraulic press, until its force limit; of a screw, a "
           "hammer or a crank press, its direction")
      .starter("0 0 -5 mm/s");
  s.expressions("velocity", velocity_components, "m/s", "its components one by one, functions of t");
  s.path("stroke_file", stroke_file, "CSV with columns time (s), position (m) along `direction`").existing_file();
  s.vector("direction", direction, "", "of the stroke").default_is("that of the velocity, else a plane's normal");
  s.real("spin", spin, "rad/s", "angular velocity about the spin_axis through `pivot`");
  s.vector("spin_axis", spin_axis, "", "in 3D").default_is("the cylinder's axis, else z; z in 2D");
  s.vector("pivot", pivot, "m", "a point of the axis of rotation").default_is("point");
  s.choice("press", press,
           {{"speed", PressKind::speed},
            {"hydraulic", PressKind::hydraulic},
            {"crank", PressKind::crank},
            {"screw", PressKind::screw},
            {"hammer", PressKind::hammer}},
           "what drives the tool");
  s.real("force_limit", force_limit, "N", "hydraulic: the speed falls so that this force is kept").above(0);
  s.real("crank_radius", crank_radius, "m", "crank").above(0);
  s.real("rod_length", rod_length, "m", "crank: length of the connecting rod").above(0);
  s.real("rotation_speed", rotation_speed, "rad/s", "crank").above(0);
  s.real("start_height", start_height, "m", "crank: height of the ram above its lowest position at the start").above(0);
  s.real("energy", energy, "J", "hammer, screw: of the blow").above(0);
  s.real("mass", mass, "kg", "hammer: falling mass; screw: the mass that has this energy at the starting speed")
      .above(0);
}

void ToolSettings::validate(Section& s) const {
  friction.validate(s);
  validate_shape(s);
  validate_motion(s);
}

/// Keys that say nothing of the shape that is chosen.
void ToolSettings::refuse_other_shapes(Section& s) const {
  const auto refuse_unless = [&](std::initializer_list<ShapeKind> shapes, std::initializer_list<const char*> keys,
                                 const char* why) {
    if (std::find(shapes.begin(), shapes.end(), shape) != shapes.end()) return;
    for (const char* key : keys) s.refuse(key, why);
  };
  refuse_unless({ShapeKind::plane}, {"normal"}, "only shape = plane has one");
  refuse_unless({ShapeKind::sphere, ShapeKind::cylinder}, {"radius"}, "only shape = sphere and cylinder have one");
  refuse_unless({ShapeKind::cylinder}, {"length"}, "only shape = cylinder has one");
  refuse_unless({ShapeKind::box}, {"size"}, "only shape = box has one");
  refuse_unless({ShapeKind::surface}, {"file", "length_unit"}, "only shape = surface has one");
  if (shape != ShapeKind::cylinder && spin == 0) s.refuse("axis", "only shape = cylinder, or a spin, has one");
  if (spin == 0) {
    for (const char* key : {"spin_axis", "pivot"}) s.refuse(key, "the tool has no spin");
  }
}

/// Keys of presses other than the one that is chosen.
void ToolSettings::refuse_other_presses(Section& s) const {
  const auto refuse_unless = [&](std::initializer_list<PressKind> presses, std::initializer_list<const char*> keys,
                                 const char* why) {
    if (std::find(presses.begin(), presses.end(), press) != presses.end()) return;
    for (const char* key : keys) s.refuse(key, why);
  };
  refuse_unless({PressKind::hydraulic}, {"force_limit"}, "only press = hydraulic has one");
  refuse_unless({PressKind::crank}, {"crank_radius", "rod_length", "rotation_speed", "start_height"},
                "only press = crank has one");
  refuse_unless({PressKind::hammer, PressKind::screw}, {"energy", "mass"}, "only press = hammer and screw have one");
}

void ToolSettings::validate_shape(Section& s) const {
  refuse_other_shapes(s);
  switch (shape) {
    case ShapeKind::plane:
      s.require("normal", "shape = plane");
      s.refuse("material", "a plane's normal says where the material is");
      break;
    case ShapeKind::sphere:
      s.require("radius", "shape = sphere");
      break;
    case ShapeKind::cylinder:
      s.require("radius", "shape = cylinder");
      break;
    case ShapeKind::box:
      s.require("size", "shape = box");
      break;
    case ShapeKind::surface:
      s.require("file", "shape = surface");
      break;
  }
  if (normal && to_vector(normal->data(), 3).norm() == 0) s.fail("normal", "has no length");
  if (axis && to_vector(axis->data(), 3).norm() == 0) s.fail("axis", "has no length");
  try {
    surface_scale();
  } catch (const InputError& error) {
    s.fail("length_unit", error.what());
  }
  if (size && to_vector(size->data(), 3).norm() == 0) s.fail("size", "has no positive edge");
}

bool ToolSettings::may_advance() const {
  if (!stroke_file.empty() || press != PressKind::speed) return true;
  if (velocity) return to_vector(velocity->data(), 3).norm() > 0;
  return velocity_components[0] || velocity_components[1] || velocity_components[2];
}

void ToolSettings::validate_motion(Section& s) const {
  const bool has_velocity = velocity || velocity_components[0] || velocity_components[1] || velocity_components[2];
  const bool has_table = !stroke_file.empty();
  for (const char* component : {"velocity_x", "velocity_y", "velocity_z"}) {
    if (velocity && s.given(component)) s.fail(component, "is already given as velocity");
  }
  refuse_other_presses(s);
  if (has_table && has_velocity) s.fail("stroke_file", "and velocity are given: one of them moves the tool");
  if (has_table && press != PressKind::speed) s.fail("stroke_file", "moves the tool by itself: press must be speed");
  const bool has_direction = direction || (velocity && to_vector(velocity->data(), 3).norm() > 0) || normal;
  if ((has_table || press != PressKind::speed) && !has_direction) {
    s.fail("direction", "is needed: neither a velocity nor a plane's normal gives it");
  }
  if (direction && to_vector(direction->data(), 3).norm() == 0) s.fail("direction", "has no length");
  switch (press) {
    case PressKind::hydraulic:
      s.require("force_limit", "press = hydraulic");
      if (!has_velocity) s.fail("velocity", "is needed: press = hydraulic moves at it below its force limit");
      break;
    case PressKind::crank:
      for (const char* key : {"crank_radius", "rod_length", "rotation_speed", "start_height"}) {
        s.require(key, "press = crank");
      }
      if (rod_length && crank_radius && !(*rod_length > *crank_radius)) {
        s.fail("rod_length", "must exceed crank_radius");
      }
      if (start_height && crank_radius && !(*start_height <= 2 * *crank_radius)) {
        s.fail("start_height", "must not exceed twice the crank_radius");
      }
      break;
    case PressKind::hammer:
    case PressKind::screw:
      s.require("energy", "press = hammer and press = screw");
      s.require("mass", "press = hammer and press = screw");
      break;
    case PressKind::speed:
    case PressKind::stroke_table:
      break;
  }
}

}  // namespace malleus::forge
