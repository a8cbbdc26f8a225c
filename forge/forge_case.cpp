#include "forge/forge_case.hpp"

#include <algorithm>

namespace malleus::forge {

void BodySettings::describe(Section& s) {
  s.string("group", group, "physical volume (surface in 2D) that the body fills")
      .required()
      .starter("billet")
      .names_volume_group();
  s.choice("law", law,
           {{"norton-hoff", BodyLaw::norton_hoff}, {"newtonian", BodyLaw::newtonian}, {"rigid", BodyLaw::rigid}},
           "how it deforms; a rigid body has no unknowns");
  s.real("rate_sensitivity", rate_sensitivity, "", "m in eta = K (sqrt(3) e)^(m-1), e the equivalent strain rate")
      .above(0)
      .at_most(1)
      .starter("0.3");
  s.real("consistency", consistency, "Pa.s^m", "K")
      .above(0)
      .starter("179.2 MPa.s^m")
      .exponent_is("rate_sensitivity", rate_sensitivity);
  s.real("viscosity", viscosity, "Pa.s", "of a newtonian body, in place of consistency").above(0);
  s.real("density", density, "kg/m^3", "for gravity and heat").above(0);
  s.flag("remesh", remesh, "whether [remesh] makes its mesh anew; no for dies that hardly deform");
  s.real("conductivity", conductivity, "W/m/K", "with [thermal]").at_least(0);
  s.real("heat_capacity", heat_capacity, "J/kg/K",
         "with [thermal]; a rigid body without it keeps its temperature at the start")
      .above(0);
  s.expression("temperature", temperature, "K", "at the start, with [thermal]")
      .above(0)
      .default_is("[thermal] initial");
  s.temperature_formula("softening", softening, "",
                        "what the consistency is multiplied with at the temperature T in K, with [thermal]: "
                        "\"exp(3000*(1/T-1/1373))\"");
}

void BodySettings::validate(Section& s) const {
  if (law == BodyLaw::norton_hoff) {
    s.require("consistency", "law = norton-hoff");
    s.refuse("viscosity", "law = norton-hoff has a consistency");
  }
  if (law == BodyLaw::newtonian) {
    s.require_one_of({"consistency", "viscosity"});
    if (rate_sensitivity != 1) s.fail("rate_sensitivity", "law = newtonian has rate_sensitivity 1");
  }
  if (law == BodyLaw::rigid) {
    s.refuse("consistency", "law = rigid does not deform");
    s.refuse("viscosity", "law = rigid does not deform");
    s.refuse("softening", "law = rigid does not deform");
  }
}

void FrictionSettings::describe(Section& s) {
  s.real("friction", coefficient, "s^(q-m).m^-q",
         "norton: f in traction = - f K |dv|^(q-1) dv (0.3 in mm and s is 0.3 * 1000^q); tresca: share of "
         "the flow stress in shear; coulomb: of the pressure")
      .at_least(0);
  s.real("friction_exponent", exponent, "", "q of the Norton law").above(0);
  s.choice("friction_law", law,
           {{"norton", FrictionLaw::norton}, {"tresca", FrictionLaw::tresca}, {"coulomb", FrictionLaw::coulomb}},
           "coulomb is limited by the flow stress in shear");
}

void FrictionSettings::validate(Section& s) const {
  if (law == FrictionLaw::tresca && !(coefficient <= 1)) s.fail("friction", "of friction_law = tresca is at most 1");
  if (law != FrictionLaw::norton) s.refuse("friction_exponent", "only friction_law = norton has one");
}

void BodyContactSettings::describe(Section& s) {
  s.string("slave", slave, "body whose nodes must not enter the master").or_word("auto").names_section("body");
  s.string("master", master, "body whose faces hold the slave's nodes").or_word("auto").names_section("body");
  s.words("bodies", bodies,
          "the two bodies, where slave and master are not given: the stiffer becomes master, of equal ones that with "
          "the coarser mesh")
      .names_section("body");
  friction.describe(s);
  s.real("penalty", penalty, "", "dimensionless penalty c of this contact, see [penalty]")
      .at_least(1)
      .at_most(1e9)
      .or_word("auto");
  s.real("heat_transfer", heat_transfer, "W/m^2/K", "between the surfaces where they touch, with [thermal]")
      .at_least(0);
}

void BodyContactSettings::validate(Section& s) const {
  friction.validate(s);
  if (!bodies.empty() && bodies.size() != 2) s.fail("bodies", "names two bodies");
  if (bodies.size() == 2 && bodies[0] == bodies[1]) s.fail("bodies", "names two different bodies");
  if (slave && master && *slave == *master) s.fail("master", "is the slave itself");
}

void ForgeTime::describe(Section& s) {
  TimeSettings::describe(s);
  s.real("stroke", stroke, "m", "stroke of the first tool or boundary that moves, at which the run ends").above(0);
}

void MotionSettings::describe(Section& s) {
  s.choice("scheme", scheme,
           {{"adams-bashforth-2", TimeScheme::adams_bashforth_2},
            {"runge-kutta-2", TimeScheme::runge_kutta_2},
            {"euler", TimeScheme::euler}},
           "how nodes move: second order at no cost; second order, two solves a step; first order (loses volume)");
  s.real("edge_share", edge_share, "", "largest change of an edge in a step, as a share of its length")
      .above(0)
      .at_most(1);
  s.real("strain", strain, "", "largest equivalent strain of an element in a step")
      .above(0)
      .default_is("0.03, 0.015, 0.007, 0.0035 by level, where [time] step is not given");
  s.choice("volume_target", volume_target,
           {{"auto", VolumeTarget::automatic}, {"yes", VolumeTarget::yes}, {"no", VolumeTarget::no}},
           "each body's lost volume is asked back in the next step; auto: not with scheme = euler");
}

void PenaltySettings::describe(Section& s) {
  s.real("penalty", penalty, "",
         "c: contact pressure is r times the closing speed that is left, r = c viscosity / edge length; errors go with "
         "1/c, above 1e9 they grow again")
      .at_least(1)
      .at_most(1e9)
      .by_level(1e3, 1e4, 1e4, 1e4);
  s.flag("augmented", augmented, "augmented Lagrangian: solves again until the penetration is below `penetration`")
      .by_level(false, false, true, true);
  s.real("penetration", penetration, "", "penetration in a step that augmentation accepts, as a share of an edge")
      .above(0)
      .by_level(1e-2, 1e-3, 1e-4, 1e-5);
  s.real("slip_scale", slip_scale, "",
         "slip below which friction is linear where it is not so at all speeds, as a share of the scene's speed")
      .above(0)
      .below(1)
      .by_level(1e-2, 1e-2, 1e-3, 1e-3);
}

namespace {

/// Two sections of one kind must not share a group of the mesh. Both are named with their lines.
template <class Settings>
void refuse_shared_groups(CaseReader& reader, const std::string& kind, const std::vector<Settings>& sections) {
  for (std::size_t i = 0; i < sections.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (sections[i].group.empty() || sections[i].group != sections[j].group) continue;
      const CaseEntry* first = reader.file().find_entry(kind, sections[j].name, "group");
      const std::string place = first != nullptr ? " (" + first->place.text() + ")" : "";
      reader.fail(kind + "." + sections[i].name, "group",
                  "is already that of [" + kind + "." + sections[j].name + "]" + place);
      break;
    }
  }
}

}  // namespace

void ForgeCase::describe(CaseReader& reader) {
  common.describe_start(reader);
  reader.section("time", time, "when the run ends, and its largest step");
  reader.repeated("body", bodies, "a body: a region of the mesh with a law", 1);
  reader.repeated("tool", tools, "a rigid tool: it has no mesh and no unknowns");
  reader.repeated("contact", contacts, "contact between two bodies");
  common.describe_scene(reader);
  reader.optional("initial", initial, "the start from another run's last state");
  reader.section("motion", motion, "how the mesh follows the material");
  reader.section("penalty", penalty, "how contact is enforced");
  common.describe_run(reader);
}

bool ForgeCase::anything_moves() const {
  return std::any_of(tools.begin(), tools.end(), [](const ToolSettings& tool) { return tool.may_advance(); }) ||
         std::any_of(common.boundaries.begin(), common.boundaries.end(), [](const BoundarySettings& boundary) {
           if (!boundary.velocity) return boundary.has_velocity();
           return std::any_of(boundary.velocity->begin(), boundary.velocity->end(),
                              [](const std::optional<Real>& component) { return component && *component != 0; });
         });
}

void ForgeCase::validate(CaseReader& reader) const {
  const auto refuse = [&](bool is_there, const char* section, const char* message) {
    if (is_there) reader.fail(section, "", message);
  };
  validate_heat(reader);
  refuse(common.inertia.has_value(), "inertia", "forge models no inertia yet; remove the section");
  refuse(common.air.has_value(), "air", "forge models no trapped air; remove the section");
  if (common.reference && common.reference->level_set) {
    reader.fail("reference", "level_set", "forge has no level set; remove the key");
  }
  refuse_shared_groups(reader, "body", bodies);
  refuse_shared_groups(reader, "boundary", common.boundaries);
  const bool has_end =
      reader.given("time", "end") || reader.given("time", "increments") || reader.given("time", "stroke");
  if (!has_end) {
    reader.fail("time", "end", "nothing ends the run: give end, increments or stroke");
  }
  if (time.stroke && !time.end && !time.increments && !anything_moves()) {
    reader.fail("time", "stroke",
                "no tool and no boundary moves, so that nothing ends the run: give end or increments");
  }
  if (common.gravity) {
    for (const BodySettings& body : bodies) {
      if (body.law != BodyLaw::rigid && !body.density) {
        reader.fail("body." + body.name, "density", "[gravity] needs the density of every body");
      }
    }
  }
  for (const BodyContactSettings& contact : contacts) {
    const bool both = contact.slave && contact.master;
    const bool two_bodies = bodies.size() == 2;
    if (!both && contact.bodies.empty() && !two_bodies) {
      reader.fail("contact." + contact.name, "slave", "give slave and master, or the two `bodies`");
    }
  }
}

void ForgeCase::validate_heat(CaseReader& reader) const {
  common.refuse_heat_without_thermal(reader);
  if (!common.thermal) return;
  for (const BodySettings& body : bodies) {
    const bool is_modelled = body.law != BodyLaw::rigid || body.heat_capacity || body.conductivity;
    if (!is_modelled) continue;
    const std::string section = "body." + body.name;
    if (!body.density) reader.fail(section, "density", "[thermal] needs the density of the body");
    if (!body.heat_capacity) reader.fail(section, "heat_capacity", "[thermal] needs the heat capacity of the body");
    if (!body.conductivity) reader.fail(section, "conductivity", "[thermal] needs the conductivity of the body");
  }
}

}  // namespace malleus::forge
