#include "case/scene_sections.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace malleus {
namespace {

constexpr std::array<std::string_view, 3> axes = {"x", "y", "z"};

bool has_any(const ExpressionVector& components) {
  return std::any_of(components.begin(), components.end(), [](const auto& component) { return component.has_value(); });
}

}  // namespace

void GravitySettings::describe(Section& s) {
  s.vector("acceleration", acceleration, "m/s^2", "of free fall; bodies and fluids need a density")
      .required()
      .starter("0 0 -9.81 m/s^2");
}

void ThermalSettings::describe(Section& s) {
  s.expression("initial", initial, "K", "temperature at the start").above(0);
  s.real("ambient", ambient, "K", "temperature around free surfaces").above(0);
  s.real("emissivity", emissivity, "", "of free surfaces, which radiate to the surroundings").at_least(0).at_most(1);
  s.real("convection", convection, "W/m^2/K", "from free surfaces to the surroundings").at_least(0);
  s.real("dissipation", dissipation, "", "share of the power of deformation that becomes heat (Taylor and Quinney)")
      .at_least(0)
      .at_most(1);
}

void AirSettings::describe(Section& s) {
  s.choice("trapped", trapped, {{"gas", TrappedAir::gas}, {"vented", TrappedAir::vented}},
           "closed pockets of air are compressed as a gas, or let their air out");
  s.real("pressure", pressure, "Pa", "absolute, of the air before it is compressed").above(0);
}

void BodyForceSettings::describe(Section& s) {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    auto key = s.expression(axes[i], force[i], "N/m^3", "force per volume");
    if (i == 2) key.only_in_3d();
  }
}

void ReferenceSettings::describe(Section& s) {
  s.expressions("velocity", velocity, "m/s", "known velocity");
  s.expression("pressure", pressure, "Pa", "known pressure");
  s.expression("level_set", level_set, "m", "known level set, positive inside");
  s.choice("at", at, {{"end", ReferenceTime::end}, {"every", ReferenceTime::every}},
           "when errors are computed: for the last state, or every increment");
}

void ReferenceSettings::validate(Section& s) const {
  if (!has_any(velocity) && !pressure && !level_set) s.fail("needs velocity_x, ..., pressure or level_set");
}

void ProbeSettings::describe(Section& s) {
  s.path("file", file, "CSV of points: x,y,z (m)").existing_file();
  s.vector("point", point, "m", "one point").starter("0 0 0 mm");
  s.words("fields", fields, "names of the fields to record").default_is("all that the scene has");
  s.choice("moves", motion, {{"no", ProbeMotion::fixed}, {"with-material", ProbeMotion::with_material}},
           "stays in space, or moves with the material");
}

void ProbeSettings::validate(Section& s) const {
  s.require_one_of({"file", "point"});
}

void InitialSettings::describe(Section& s) {
  s.path("from", from, "output directory of another run, whose last state this one starts from").existing_directory();
}

void BoundarySettings::describe(Section& s) {
  s.string("group", group, "physical surface (curve in 2D) of the mesh")
      .required()
      .starter("bottom")
      .names_surface_group();
  s.choice("type", type, {{"imposed", Type::imposed}, {"symmetry", Type::symmetry}},
           "imposed: what the keys below give; symmetry: no flow through it, no shear on it");
  s.partial_vector("velocity", velocity, "m/s", "velocity, one number or the word free a dimension")
      .starter("0 0 free mm/s");
  s.expressions("velocity", velocity_components, "m/s", "its components one by one; one that is not given is free");
  s.vector("traction", traction, "Pa", "force per area, one number a dimension");
  s.expressions("traction", traction_components, "Pa", "its components one by one");
  s.expression("pressure", pressure, "Pa", "pressure that presses on the body");
  s.expression("temperature", temperature, "K", "imposed temperature, with [thermal]").above(0);
  s.expression("heat_flux", heat_flux, "W/m^2", "heat that flows in, with [thermal]");
}

void BoundarySettings::validate(Section& s) const {
  s.refuse_more_than_one_of({"temperature", "heat_flux"});
  const bool imposes = has_velocity() || has_traction() || pressure.has_value();
  if (type == Type::symmetry && imposes) s.fail("type", "symmetry allows no velocity, traction or pressure");
  if (type == Type::imposed && !imposes && !has_heat()) {
    s.fail("needs velocity, traction, pressure or type = symmetry");
  }
  refuse_two_causes(s);
  for (const std::string_view axis : axes) {
    for (const std::string_view quantity : {"velocity", "traction"}) {
      const std::string component = std::string(quantity) + "_" + std::string(axis);
      if (s.given(quantity) && s.given(component)) s.fail(component, "is already given as " + std::string(quantity));
    }
  }
}

/// Where the velocity is imposed a force does nothing. A component that is free may carry a traction.
void BoundarySettings::refuse_two_causes(Section& s) const {
  if (!has_velocity()) return;
  const ExpressionVector imposed = imposed_velocity();
  const bool all = std::all_of(imposed.begin(), imposed.end(), [](const auto& one) { return one.has_value(); });
  if (pressure && all) s.fail("pressure", "the velocity is imposed, so that a pressure does nothing");
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (!imposed[i]) continue;
    const bool loaded = traction ? (*traction)[i] != 0 : traction_components[i].has_value();
    if (!loaded) continue;
    s.fail(traction ? "traction" : "traction_" + std::string(axes[i]),
           fmt::format("the velocity along {} is imposed, so that a traction along it does nothing", axes[i]));
    return;
  }
}

bool BoundarySettings::has_velocity() const {
  return velocity || has_any(velocity_components);
}

bool BoundarySettings::has_traction() const {
  return traction || has_any(traction_components);
}

ExpressionVector BoundarySettings::imposed_velocity() const {
  if (!velocity) return velocity_components;
  ExpressionVector result;
  for (std::size_t i = 0; i < result.size(); ++i) {
    if ((*velocity)[i]) result[i] = Expression(*(*velocity)[i]);
  }
  return result;
}

std::array<Expression, 3> BoundarySettings::imposed_traction() const {
  std::array<Expression, 3> result;
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (traction) {
      result[i] = Expression((*traction)[i]);
    } else if (traction_components[i]) {
      result[i] = *traction_components[i];
    }
  }
  return result;
}

}  // namespace malleus
