#include "inject/sections.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"
#include "fem/level_set_shapes.hpp"

namespace malleus::inject {
namespace {

bool has_any(const ExpressionVector& components) {
  return std::any_of(components.begin(), components.end(), [](const auto& component) { return component.has_value(); });
}

/// One number or formula: a speed along the inward normal; two or three numbers: a vector.
Converter<GateVelocity> gate_velocity_converter() {
  const auto read = [](std::string_view raw, Key& key) {
    GateVelocity velocity;
    try {
      velocity.speed = expression_converter("m/s").read(raw, key);
      velocity.speed->set_source(key.source);
      return velocity;
    } catch (const InputError&) {
      const auto components = vector_converter("m/s").read(raw, key);
      for (std::size_t i = 0; i < components.size(); ++i) {
        velocity.vector[i] = Expression(components[i]);
        velocity.vector[i]->set_source(key.source);
      }
      return velocity;
    }
  };
  const auto write = [](const GateVelocity& velocity) {
    if (velocity.speed) return expression_converter("m/s").write(*velocity.speed);
    std::array<Real, 3> components = {};
    for (std::size_t i = 0; i < components.size(); ++i) components[i] = (*velocity.vector[i])({}, 0);
    return vector_converter("m/s").write(components);
  };
  return {"speed along the inward normal, or a vector", "m/s", read, write};
}

Converter<FlowUpdate> flow_update_converter() {
  const auto read = [](std::string_view raw, Key& key) -> FlowUpdate {
    if (raw == "once") return {FlowUpdate::Kind::once, 1};
    if (raw == "auto") return {FlowUpdate::Kind::automatic, 1};
    if (raw.starts_with("every ")) {
      const int every = integer_converter().read(raw.substr(6), key);
      if (every >= 1) return {FlowUpdate::Kind::every, every};
    }
    throw InputError(fmt::format("'{}' is none of: once, every N (N >= 1), auto", raw));
  };
  const auto write = [](const FlowUpdate& update) -> std::string {
    if (update.kind == FlowUpdate::Kind::once) return "once";
    return update.kind == FlowUpdate::Kind::automatic ? "auto" : fmt::format("every {}", update.every);
  };
  return {"once | every N | auto", "", read, write};
}

}  // namespace

void FluidSettings::describe(Section& s) {
  s.choice("law", law,
           {{"newtonian", Law::newtonian},
            {"power-law", Law::power_law},
            {"carreau-yasuda", Law::carreau_yasuda},
            {"cross", Law::cross},
            {"void", Law::empty}},
           "how the viscosity depends on the shear rate; void: not modelled, only its pressure acts");
  s.expression("viscosity", viscosity, "Pa.s", "of the fluid; at rest for carreau-yasuda and cross")
      .above(0)
      .starter("1000 Pa.s");
  s.real("consistency", consistency, "Pa.s^n", "K of the power law, K (shear rate)^(n-1)")
      .above(0)
      .exponent_is("exponent", exponent);
  s.real("exponent", exponent, "", "n of the power law, carreau-yasuda and cross").above(0);
  s.real("infinite_viscosity", infinite_viscosity, "Pa.s", "limit at high shear rates: carreau-yasuda and cross")
      .at_least(0);
  s.real("time_constant", time_constant, "s", "lambda of carreau-yasuda and cross").above(0);
  s.real("transition", transition, "", "a of carreau-yasuda").above(0);
  s.real("density", density, "kg/m^3", "wanted where [gravity] acts").above(0);
}

void FluidSettings::validate(Section& s) const {
  if (law == Law::power_law) {
    s.require("consistency", "law = power-law");
    s.require("exponent", "law = power-law");
    s.refuse("viscosity", "the power law has a consistency and an exponent");
    return;
  }
  s.refuse("consistency", "only the power law has one");
  if (law == Law::empty) {
    s.refuse("viscosity", "a void fluid has none");
    return;
  }
  s.require("viscosity", "the fluid's law has one");
  if (law == Law::newtonian) {
    for (const char* key : {"exponent", "infinite_viscosity", "time_constant", "transition"}) {
      s.refuse(key, "law = newtonian has none");
    }
    return;
  }
  s.require("time_constant", "carreau-yasuda and cross have one");
  s.require("exponent", "carreau-yasuda and cross have one");
  if (viscosity && !viscosity->is_constant()) s.fail("viscosity", "may be a formula for law = newtonian only");
  if (law == Law::cross && exponent >= 1) s.fail("exponent", "of the Cross law must be below 1");
}

Real FluidSettings::reference_viscosity() const {
  if (law == Law::empty) return 0;
  if (law == Law::power_law) return consistency.value_or(0);
  return viscosity && viscosity->is_constant() ? (*viscosity)({}, 0) : 0;
}

void InitialFluid::describe(Section& s) {
  InitialSettings::describe(s);
  s.string("fluid", fluid, "what fills the cavity at the start").starter("air").names_section("fluid");
}

void InitialShape::describe(Section& s) {
  s.string("fluid", fluid, "that is there at the start").required().starter("melt").names_section("fluid");
  s.choice("shape", shape, {{"sphere", Shape::sphere}, {"box", Shape::box}, {"half-space", Shape::half_space}},
           "of the fluid's part (in 2D a sphere is a disc, a half-space a half-plane)");
  s.vector("center", center, "m", "of a sphere or box").starter("0 0 0 mm");
  s.real("radius", radius, "m", "of a sphere").above(0);
  s.vector("size", size, "m", "edge lengths of a box");
  s.vector("point", point, "m", "on the face of a half-space");
  s.vector("normal", normal, "", "of a half-space, out of the fluid");
  s.expression("level_set", level_set, "m", "positive inside the fluid, in place of a shape");
}

void InitialShape::validate(Section& s) const {
  s.require_one_of({"shape", "level_set"});
  if (!shape) return;
  if (*shape == Shape::half_space) {
    s.require("point", "shape = half-space");
    s.require("normal", "shape = half-space");
    if (normal && (*normal)[0] == 0 && (*normal)[1] == 0 && (*normal)[2] == 0) s.fail("normal", "must not be zero");
    return;
  }
  s.require("center", *shape == Shape::sphere ? "shape = sphere" : "shape = box");
  if (*shape == Shape::sphere) s.require("radius", "shape = sphere");
  if (*shape == Shape::box) s.require("size", "shape = box");
}

Real InitialShape::signed_distance(const std::array<Real, 3>& at, int dim) const {
  if (level_set) return (*level_set)(at, 0);
  switch (*shape) {
    case Shape::sphere:
      return malleus::signed_distance(Sphere{*center, *radius}, at);
    case Shape::box:
      return malleus::signed_distance(AxisBox{*center, *size, dim}, at);
    case Shape::half_space:
      return malleus::signed_distance(HalfSpace{*point, *normal}, at);
  }
  return 0;
}

void InletSettings::describe(Section& s) {
  s.string("group", group, "physical surface (curve in 2D) of the gate")
      .required()
      .starter("gate")
      .names_surface_group();
  s.string("fluid", fluid, "that comes in").starter("melt").names_section("fluid");
  s.custom("velocity", velocity, gate_velocity_converter(),
           "of the inflow; rescaled so that the flow through the "
           "mesh's gate is exactly the one asked for");
  s.expressions("velocity", velocity_components, "m/s", "component of the velocity of the inflow");
  s.expression("flow_rate", flow_rate, "m^3/s", "into the cavity; per metre of depth in plane scenes")
      .starter("50 cm^3/s");
  s.expression("pressure", pressure, "Pa", "on the gate");
  s.real("switch_pressure", switch_pressure, "Pa", "gate pressure at which then_pressure takes over").above(0);
  s.real("switch_fill", switch_fill, "", "fill fraction at which then_pressure takes over").above(0).at_most(1);
  s.real("then_pressure", then_pressure, "Pa", "on the gate after the switch-over").at_least(0);
}

void InletSettings::validate(Section& s) const {
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string key = std::string("velocity_") + "xyz"[i];
    if (velocity && velocity_components[i]) s.fail(key, "is already given as velocity");
  }
  const int ways = (has_velocity() ? 1 : 0) + (flow_rate ? 1 : 0) + (pressure ? 1 : 0);
  if (ways != 1) s.fail("needs one of velocity, flow_rate and pressure");
  constexpr const char* outward =
      "an inlet lets fluid into the cavity: give a positive value, or let fluid out of a [vent.NAME]";
  if (flow_rate && flow_rate->is_constant() && (*flow_rate)({}, 0) < 0) s.fail("flow_rate", outward);
  if (velocity && velocity->speed && velocity->speed->is_constant() && (*velocity->speed)({}, 0) < 0) {
    s.fail("velocity", outward);
  }
  if (switches() != then_pressure.has_value()) {
    s.fail("a switch-over needs then_pressure and one of switch_pressure and switch_fill");
  }
  if (switches() && pressure) s.fail("switch-over is from velocity or flow_rate to pressure");
}

bool InletSettings::has_velocity() const {
  return velocity || has_any(velocity_components);
}

bool InletSettings::depends_on_time() const {
  const auto changes = [](const std::optional<Expression>& formula) { return formula && formula->depends_on_time(); };
  if (velocity && (changes(velocity->speed) || std::ranges::any_of(velocity->vector, changes))) return true;
  return changes(flow_rate) || changes(pressure) || std::ranges::any_of(velocity_components, changes);
}

void VentSettings::describe(Section& s) {
  s.string("group", group, "physical surface (curve in 2D) of the vent")
      .required()
      .starter("vent")
      .names_surface_group();
  s.expression("pressure", pressure, "Pa", "outside");
  s.choice(
      "seals", seals, {{"auto", Seals::automatic}, {"yes", Seals::yes}, {"no", Seals::no}},
      "whether it lets out only what filled the cavity at the start, and closes where another fluid arrives; auto: "
      "yes, unless another fluid is at it from the start");
}

void WallSettings::describe(Section& s) {
  s.string("group", group, "physical surface (curve in 2D) of the wall")
      .required()
      .starter("wall")
      .names_surface_group();
  s.choice("condition", condition, {{"no-slip", Condition::no_slip}, {"slip", Condition::slip}},
           "whether the fluids stick to it");
  s.string("only", only, "fluid that sticks while the others slip").names_section("fluid");
}

void WallSettings::validate(Section& s) const {
  if (condition == Condition::slip) s.refuse("only", "with condition = slip no fluid sticks");
}

void SymmetrySettings::describe(Section& s) {
  s.string("group", group, "physical surface (curve in 2D)").required().starter("symmetry").names_surface_group();
}

void FrontSettings::describe(Section& s) {
  s.choice(
      "mixture", mixture,
      {{"fraction", MixtureLaw::fraction},
       {"heaviside", MixtureLaw::heaviside},
       {"sharp", MixtureLaw::sharp},
       {"harmonic", MixtureLaw::harmonic}},
      "viscosity of elements that the front cuts: by exact cut fraction, by distance over a thickness (the paper's; "
      "too stiff by the thickness), by the centroid, or harmonic (for fronts along the flow)");
  s.real("thickness", thickness, "", "half thickness of mixture = heaviside, in elements").above(0);
  s.choice("transport", transport,
           {{"crank-nicolson", Transport::crank_nicolson},
            {"residual-free-bubbles", Transport::residual_free_bubbles},
            {"trace", Transport::trace}},
           "of the level set: stabilized with the transient tau, with the paper's (24 % against 18 % error in the "
           "vortex), or traced back along a flow that is solved once");
  s.choice("redistance", redistance, {{"on-demand", Redistance::on_demand}, {"never", Redistance::never}},
           "whether the level set is made a distance again where its slope leaves [1/3, 3]");
  s.real("narrow_band", narrow_band, "", "elements on either side of the front that are transported; none: all")
      .at_least(3)
      .or_word("none");
  s.real("cfl", cfl, "",
         "largest share of an element that the front crosses in a substep (1 costs 9 % of gate pressure, "
         "0.25 to 0.5 costs 1 to 2 %)")
      .above(0)
      .at_most(2)
      .by_level(1, 0.5, 0.25, 0.125);
  s.real("contrast", contrast, "",
         "largest ratio of viscosities; thinner fluids are thickened to it. auto: 1e4 while filling (changes flows by "
         "3e-4 against 1e6), none in a steady flow")
      .at_least(1)
      .or_word("auto");
}

Stabilization FrontSettings::stabilization() const {
  return transport == Transport::residual_free_bubbles ? Stabilization::residual_free_bubbles
                                                       : Stabilization::transient;
}

void FlowSettings::describe(Section& s) {
  s.custom("update", update, flow_update_converter(),
           "when the flow is solved again; once is wrong by 40 % as soon as there are two flow paths");
  s.real("update_distance", update_distance, "",
         "elements that the front moves between two solves (auto); 1 misplaces 1 % of the volume, 4 3.9 %; 0 = every "
         "increment")
      .at_least(0)
      .by_level(4, 1, 0.5, 0);
  s.expressions("prescribed", prescribed, "m/s", "component of a given flow: none is solved, only the front moves");
}

bool FlowSettings::is_prescribed() const {
  return has_any(prescribed);
}

void InjectCase::describe(CaseReader& reader) {
  common.describe_start(reader);
  reader.section("time", time, "how long the filling lasts");
  reader.repeated("fluid", fluids, "a fluid", 1);
  reader.optional("initial", initial, "what fills the cavity at the start");
  reader.repeated("initial", shapes, "where else a fluid is at the start");
  reader.repeated("inlet", inlets, "a gate through which fluid comes in");
  reader.repeated("vent", vents, "an opening through which fluid leaves");
  reader.repeated("wall", walls, "a wall");
  reader.repeated("symmetry", symmetries, "a plane of symmetry");
  reader.section("front", front, "the front between the fluids");
  reader.section("flow", flow, "when the flow is solved");
  common.describe_scene(reader);
  common.describe_run(reader);
}

int InjectCase::fluid_index(const std::string& name) const {
  const auto found = std::find_if(fluids.begin(), fluids.end(), [&](const auto& fluid) { return fluid.name == name; });
  return found == fluids.end() ? -1 : static_cast<int>(found - fluids.begin());
}

int InjectCase::initial_fluid() const {
  return initial && !initial->fluid.empty() ? fluid_index(initial->fluid) : 0;
}

/// Whether anything in the case can move the fluids.
bool InjectCase::is_driven() const {
  const auto presses = [](const VentSettings& vent) {
    return !vent.pressure.is_constant() || vent.pressure({}, 0) != 0;
  };
  const auto acts = [](const BoundarySettings& boundary) { return boundary.type != BoundarySettings::Type::symmetry; };
  return !inlets.empty() || flow.is_prescribed() || common.gravity || common.body_force ||
         std::any_of(vents.begin(), vents.end(), presses) ||
         std::any_of(common.boundaries.begin(), common.boundaries.end(), acts);
}

/// A trace goes along streams that stay as they are.
void InjectCase::check_trace(CaseReader& reader) const {
  const auto refuse = [&](bool is_wrong, const char* why) {
    if (is_wrong) reader.fail("front", "transport", std::string("trace ") + why + "; use crank-nicolson");
  };
  refuse(fluids.size() > 2, "is for two fluids");
  refuse(!flow.is_prescribed() && flow.update.kind != FlowUpdate::Kind::once,
         "is for a flow that stays as it is: [flow] update = once, or a prescribed one");
  refuse(!flow.is_prescribed() && inlets.empty(), "of a solved flow starts at an [inlet.NAME]");
  const bool changes = std::any_of(flow.prescribed.begin(), flow.prescribed.end(),
                                   [](const auto& formula) { return formula && formula->depends_on_time(); });
  refuse(changes && !inlets.empty(), "with an [inlet.NAME] is for a flow that does not depend on t");
  refuse(common.remesh && common.remesh->active, "keeps its mesh: remove [remesh]");
  refuse(common.inertia.has_value(), "is for flows without [inertia]");
  refuse(std::any_of(fluids.begin(), fluids.end(),
                     [](const FluidSettings& fluid) { return fluid.law == FluidSettings::Law::empty; }),
         "wants a viscosity of all fluids, not void");
}

void InjectCase::check_inertia(CaseReader& reader) const {
  for (const FluidSettings& fluid : fluids) {
    if (!fluid.density && fluid.law != FluidSettings::Law::empty) {
      reader.fail("fluid." + fluid.name, "density", "[inertia] wants the density of every fluid");
    }
  }
  if (flow.is_prescribed()) reader.fail("inertia", "", "a prescribed flow has none; remove the section");
  if (flow.update.kind != FlowUpdate::Kind::automatic) {
    reader.fail("flow", "update", "with [inertia] the flow is solved every increment; use auto");
  }
  if (common.solver.linear_method == LinearChoice::conjugate_residual) {
    reader.fail("solver", "linear_method", "[inertia] makes the equations unsymmetric; use another method");
  }
  if (time.increments != 0 && !time.step) {
    reader.fail("time", "step", "must be given with [inertia]: the flow starts from rest, which tells no step");
  }
}

void InjectCase::check(CaseReader& reader) const {
  if (is_driven() && fluids.size() > 1 && inlets.empty() && shapes.empty() && time.increments != 0) {
    reader.fail("inlet", "",
                "there is no front: add an [inlet.NAME] for a fluid to come in, or an [initial.NAME] where it is");
  }
  const bool is_mixture = fluids.size() > 1;
  if (is_mixture && (!initial || initial->fluid.empty())) {
    reader.fail("initial", "fluid", "several fluids: [initial] fluid must name the one that fills the cavity");
  }
  for (const InletSettings& inlet : inlets) {
    const int fluid = fluid_index(inlet.fluid);
    if (fluid >= 0 && fluids[static_cast<std::size_t>(fluid)].law == FluidSettings::Law::empty) {
      reader.fail("inlet." + inlet.name, "fluid", "is void, which does not flow: give it a small viscosity");
    }
    if (is_mixture && inlet.fluid.empty()) reader.fail("inlet." + inlet.name, "fluid", "must be given: several fluids");
  }
  for (const InitialShape& shape : shapes) {
    if (initial && shape.fluid == initial->fluid) {
      reader.fail("initial." + shape.name, "fluid", fmt::format("'{}' fills the cavity already", shape.fluid));
    }
  }
  const auto refuse = [&](bool is_given, const char* section, const char* why) {
    if (is_given) reader.fail(section, "", why);
  };
  refuse(common.thermal.has_value(), "thermal", "inject models no heat yet; remove the section");
  common.refuse_heat_without_thermal(reader);
  if (common.inertia) check_inertia(reader);
  refuse(common.air && (!is_mixture || fluids[static_cast<std::size_t>(std::max(0, initial_fluid()))].law !=
                                           FluidSettings::Law::empty),
         "air", "is about air that is not modelled as a fluid: [initial] fluid needs law = void");
  if (front.transport == FrontSettings::Transport::trace) check_trace(reader);
  for (std::size_t i = 0; i < fluids.size(); ++i) {
    if (fluids[i].law != FluidSettings::Law::empty || (is_mixture && static_cast<int>(i) == initial_fluid())) continue;
    reader.fail("fluid." + fluids[i].name, "law",
                "void is what fills the cavity at the start, [initial] fluid, and is driven out by others; give this "
                "fluid a small viscosity");
  }
  if (common.gravity) {
    for (const FluidSettings& fluid : fluids) {
      if (!fluid.density && fluid.law != FluidSettings::Law::empty) {
        reader.fail("fluid." + fluid.name, "density", "[gravity] wants the density of every fluid");
      }
    }
  }
  if (flow.is_prescribed() && !inlets.empty() && time.increments == 0) {
    reader.fail("flow", "prescribed_x", "with increments = 0 there is nothing to do in a given flow");
  }
}

}  // namespace malleus::inject
