#include <cmath>

#include "base/error.hpp"
#include "base/log.hpp"
#include "forge/build_tool.hpp"
#include "forge/scene.hpp"
#include "material/viscous_law.hpp"

namespace malleus::forge {
namespace {

/// A die's viscosity beyond this multiple of the workpiece's changes nothing but the condition of the equations.
constexpr Real die_cap = 1e6;

/// Norton-Hoff's viscosity K (sqrt(3) e)^(m-1) with e the equivalent strain rate.
Real viscosity_at(const Body& body, Real rate) {
  return body.consistency * std::pow(std::sqrt(3.0) * rate, body.sensitivity - 1);
}

std::vector<Body> read_bodies(const Mesh& mesh, const ForgeCase& forge_case) {
  std::vector<Body> bodies(mesh.region_names.size());
  for (const BodySettings& settings : forge_case.bodies) {
    const int region = mesh.find_region(settings.group);
    check(region >= 0, "the groups of bodies are in the mesh");
    Body& body = bodies[static_cast<std::size_t>(region)];
    check(body.name.empty(), "no two bodies share a group");
    body.name = settings.name;
    body.law = settings.law;
    body.consistency = settings.coefficient();
    body.sensitivity = settings.law == BodyLaw::newtonian ? 1 : settings.rate_sensitivity;
    body.density = settings.density.value_or(0);
  }
  return bodies;
}

/// Every element belongs to a body.
void refuse_orphans(const Communicator& comm, const Mesh& mesh, const std::vector<Body>& bodies) {
  for (std::size_t region = 0; region < bodies.size(); ++region) {
    GlobalId elements = 0;
    for (const std::int32_t r : mesh.element_region) elements += r == static_cast<std::int32_t>(region) ? 1 : 0;
    if (comm.sum(elements) > 0 && bodies[region].name.empty()) {
      throw InputError("the elements of the group '" + mesh.region_names[region] +
                       "' belong to no body: add [body.NAME] with group = " + mesh.region_names[region]);
    }
  }
}

Bounds bounds_of_deformable(const Scene& scene) {
  Bounds box;
  for (LocalId e = 0; e < scene.mesh.elements(); ++e) {
    const auto region = static_cast<std::size_t>(scene.mesh.element_region[static_cast<std::size_t>(e)]);
    if (!scene.bodies[region].is_deformable()) continue;
    for (const LocalId node : scene.mesh.nodes_of_element(e)) box.add(to_vector(scene.mesh.point(node), scene.dim()));
  }
  for (Eigen::Index i = 0; i < 3; ++i) {
    box.low[i] = scene.comm->min(box.low[i]);
    box.high[i] = scene.comm->max(box.high[i]);
  }
  return box;
}

/// Without any motion imposed: the rate at which the loads deform the softest body.
Real rate_of_loads(const Scene& scene, Real height) {
  Real stress = 0;
  const StokesLoads loads = scene.boundaries->loads(0);
  for (const FacetTraction& traction : loads.tractions) {
    for (const Real t : traction.traction) stress = std::max(stress, std::abs(t));
  }
  for (const Real f : loads.element_force) stress = std::max(stress, std::abs(f) * height);
  for (const Real f : loads.node_force) stress = std::max(stress, std::abs(f) * height);
  stress = scene.comm->max(stress);
  Real rate = 0;
  for (const Body& body : scene.bodies) {
    if (body.consistency > 0 && stress > 0) {
      rate = std::max(rate, std::pow(stress / body.consistency, 1 / body.sensitivity));
    }
  }
  return rate > 0 ? rate : 1;
}

ReferenceScale find_scale(const Scene& scene) {
  const Bounds box = bounds_of_deformable(scene);
  const Vector extent = box.empty() ? Vector(Vector::Ones()) : Vector(box.high - box.low);
  const auto dims = extent.head(scene.dim());
  ReferenceScale scale;
  scale.height = dims.maxCoeff();
  Vector fastest = Vector::Zero();
  for (const Tool& tool : scene.tools) {
    const Real speed = std::max(tool.largest_speed(box), tool.nominal_speed());
    if (speed <= scale.speed) continue;
    scale.speed = speed;
    fastest = tool.motion().direction;
  }
  for (std::size_t i = 0; i < scene.boundaries->settings().size(); ++i) {
    const auto mean = scene.boundaries->mean_velocity(i, 0);
    const Vector velocity = to_vector(mean.data(), 3);
    if (velocity.norm() <= scale.speed) continue;
    scale.speed = velocity.norm();
    fastest = velocity.normalized();
  }
  scale.speed = std::max(scale.speed, scene.boundaries->largest_speed(0));
  if (fastest.squaredNorm() > 0) {
    const Real along = extent.cwiseProduct(fastest.cwiseAbs()).sum();
    if (along > 0) scale.height = along;
  }
  if (!(scale.speed > 0)) scale.speed = rate_of_loads(scene, scale.height) * scale.height;
  return scale;
}

/// Dies many times stiffer than the workpiece are kept to die_cap times its viscosity at the reference rate: at a small
/// rate sensitivity m a die K times stiffer deforms K^(1/m) times slower, which no linear solver should see.
std::vector<std::unique_ptr<const ViscousLaw>> make_laws(const Scene& scene) {
  Real softest = 1e300;
  for (const Body& body : scene.bodies) {
    if (body.is_deformable() && !body.name.empty()) softest = std::min(softest, viscosity_at(body, scene.scale.rate()));
  }
  const Real cut_off = std::sqrt(3.0) * scene.solver.cutoff_strain_rate * scene.scale.rate();
  std::vector<std::unique_ptr<const ViscousLaw>> laws;
  for (const Body& body : scene.bodies) {
    if (!body.is_deformable() || body.name.empty()) {
      laws.push_back(nullptr);
      continue;
    }
    std::unique_ptr<const ViscousLaw> law;
    const bool is_linear = body.sensitivity == 1;
    if (is_linear) {
      law = std::make_unique<NewtonianLaw>(body.consistency);
    } else {
      law = std::make_unique<NortonHoffLaw>(NortonHoff{body.consistency, body.sensitivity, cut_off});
    }
    const Real at_rest = is_linear ? body.consistency : body.consistency * std::pow(cut_off, body.sensitivity - 1);
    const bool is_die = viscosity_at(body, scene.scale.rate()) > 10 * softest;
    if (is_die && at_rest > die_cap * softest) {
      log::info(
          "body {}: its viscosity is kept to {:.3g} Pa.s, {:.0e} times that of the softest body at the reference "
          "rate {:.3g} 1/s",
          body.name, die_cap * softest, die_cap, scene.scale.rate());
      law = std::make_unique<ClampedLaw>(std::move(law), 0, die_cap * softest);
    }
    laws.push_back(std::move(law));
  }
  return laws;
}

BodyLoads body_loads(const Scene& scene, const CommonSections& common) {
  BodyLoads loads;
  for (const Body& body : scene.bodies) {
    loads.is_rigid.push_back(body.is_deformable() ? 0 : 1);
    if (!common.gravity) continue;
    std::array<Real, 3> force = common.gravity->acceleration;
    for (Real& f : force) f *= body.is_deformable() ? body.density : 0;
    loads.gravity.push_back(force);
  }
  if (common.body_force) loads.force.assign(common.body_force->force.begin(), common.body_force->force.end());
  return loads;
}

std::vector<BodyScale> find_body_scales(const Scene& scene) {
  const FreeSurface surface(*scene.comm, scene.mesh, scene.geometry, scene.boundaries->is_free());
  std::vector<BodyScale> scales;
  for (std::size_t region = 0; region < scene.bodies.size(); ++region) {
    const Body& body = scene.bodies[region];
    BodyScale& scale = scales.emplace_back();
    scale.is_deformable = body.is_deformable();
    scale.consistency = body.consistency;
    scale.viscosity = body.is_deformable() ? viscosity_at(body, scene.scale.rate()) : 0;
    scale.edge = surface.mean_edge(*scene.comm, static_cast<std::int32_t>(region));
    if (!(scale.edge > 0)) scale.edge = scene.scale.height;
    scale.is_held = scene.boundaries->is_held(static_cast<std::int32_t>(region));
  }
  return scales;
}

std::int32_t region_of(const Scene& scene, const std::string& body) {
  for (std::size_t region = 0; region < scene.bodies.size(); ++region) {
    if (scene.bodies[region].name == body) return static_cast<std::int32_t>(region);
  }
  throw Defect("a contact names a body that exists", std::source_location::current());
}

/// Of two bodies in all, the one that is not `region`.
std::int32_t other_body(const Scene& scene, std::int32_t region) {
  for (std::size_t other = 0; other < scene.bodies.size(); ++other) {
    if (!scene.bodies[other].name.empty() && static_cast<std::int32_t>(other) != region) {
      return static_cast<std::int32_t>(other);
    }
  }
  throw InputError("a contact needs two bodies");
}

/// The two bodies of a contact; slave first where the case says which it is.
std::array<std::int32_t, 2> bodies_of(const Scene& scene, const BodyContactSettings& settings) {
  if (settings.bodies.size() == 2) return {region_of(scene, settings.bodies[0]), region_of(scene, settings.bodies[1])};
  if (settings.slave) {
    const std::int32_t slave = region_of(scene, *settings.slave);
    return {slave, settings.master ? region_of(scene, *settings.master) : other_body(scene, slave)};
  }
  const std::int32_t master = settings.master ? region_of(scene, *settings.master) : other_body(scene, -1);
  return {other_body(scene, master), master};
}

BodyPair resolve(const Scene& scene, const BodyContactSettings& settings) {
  const std::array<std::int32_t, 2> two = bodies_of(scene, settings);
  BodyPair pair;
  pair.name = settings.name;
  pair.friction = settings.friction.spec();
  pair.penalty = settings.penalty;
  const auto scale = [&](std::int32_t region) { return scene.body_scales[static_cast<std::size_t>(region)]; };
  const bool chosen = settings.slave || settings.master;
  const bool first_is_slave = chosen || is_better_master(scale(two[1]), scale(two[0]));
  pair.slave = first_is_slave ? two[0] : two[1];
  pair.master = first_is_slave ? two[1] : two[0];
  const std::string& slave = scene.bodies[static_cast<std::size_t>(pair.slave)].name;
  const std::string& master = scene.bodies[static_cast<std::size_t>(pair.master)].name;
  if (!scale(pair.slave).is_deformable) {
    throw InputError("[contact." + settings.name + "]: body " + slave + " is rigid and cannot be the slave");
  }
  log::info("contact {}: {} is slave, {} is master", settings.name, slave, master);
  return pair;
}

}  // namespace

bool is_better_master(const BodyScale& one, const BodyScale& two) {
  if (one.is_deformable != two.is_deformable) return !one.is_deformable;
  if (one.consistency != two.consistency) return one.consistency > two.consistency;
  if (one.viscosity != two.viscosity) return one.viscosity > two.viscosity;
  return one.edge >= two.edge;
}

void build_scene(const Communicator& comm, Mesh mesh, const ForgeCase& forge_case, Scene& scene) {
  scene.comm = &comm;
  scene.mesh = std::move(mesh);
  scene.geometry =
      forge_case.common.case_settings.geometry == CaseGeometry::axisymmetric ? Geometry::axisymmetric : Geometry::plane;
  scene.solver = forge_case.common.solver;
  scene.penalty = forge_case.penalty;
  scene.motion = forge_case.motion;
  scene.bodies = read_bodies(scene.mesh, forge_case);
  refuse_orphans(comm, scene.mesh, scene.bodies);
  for (const ToolSettings& settings : forge_case.tools) scene.tools.push_back(build_tool(comm, settings, scene.dim()));
  scene.boundaries = std::make_unique<Boundaries>(comm, scene.mesh, scene.geometry, forge_case.common.boundaries,
                                                  body_loads(scene, forge_case.common));
  scene.scale = find_scale(scene);
  scene.viscosity = std::make_unique<RegionViscosity>(make_laws(scene));
  scene.body_scales = find_body_scales(scene);
  for (const BodyContactSettings& contact : forge_case.contacts) scene.pairs.push_back(resolve(scene, contact));
  scene.contact = {scene.penalty.penalty, scene.penalty.slip_scale * scene.scale.speed, 1e-5};
  declare_fields(scene);
  build_thermal_scene(forge_case, scene);
  const std::vector<Real> volumes = body_volumes(scene);
  for (std::size_t region = 0; region < scene.bodies.size(); ++region) {
    scene.bodies[region].start_volume = volumes[region];
    scene.bodies[region].volume = volumes[region];
  }
  scene.progress.boundary_strokes.assign(scene.boundaries->settings().size(), 0.0);
  scene.progress.body_strokes.assign(scene.bodies.size(), 0.0);
  scene.progress.volume_targets.assign(scene.bodies.size(), 0.0);
  scene.progress.asked_strains.assign(scene.bodies.size(), 0.0);
  scene.progress.volume_losses.assign(scene.bodies.size(), 0.0);
}

}  // namespace malleus::forge
