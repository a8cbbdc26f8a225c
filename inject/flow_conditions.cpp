#include "inject/flow_conditions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "parallel/agreement.hpp"

namespace malleus::inject {
namespace {

constexpr std::array<Real, 3> at_rest = {0, 0, 0};

std::array<Real, 3> place_of(const Mesh& mesh, LocalId node) {
  std::array<Real, 3> place = {0, 0, 0};
  std::copy_n(mesh.point(node), mesh.dim, place.begin());
  return place;
}

/// Inward velocity that an inlet asks for at a place, given the inward unit normal there.
std::array<Real, 3> asked_velocity(const InletSettings& inlet, const std::array<Real, 3>& place, const Real* inward,
                                   int dim, Real time) {
  std::array<Real, 3> velocity = {0, 0, 0};
  if (inlet.velocity && inlet.velocity->speed) {
    const Real speed = inlet.velocity->speed->finite_at(place, time);
    for (int c = 0; c < dim; ++c) velocity[static_cast<std::size_t>(c)] = speed * inward[c];
    return velocity;
  }
  const ExpressionVector& components = inlet.velocity ? inlet.velocity->vector : inlet.velocity_components;
  for (std::size_t c = 0; c < static_cast<std::size_t>(dim); ++c) {
    if (components[c]) velocity[c] = components[c]->finite_at(place, time);
  }
  return velocity;
}

/// Points of a facet by barycentric coordinates, and weights that sum to 1: exact for polynomials of degree 5 on a
/// segment and 4 on a triangle (Dunavant 1985).
template <int D>
std::vector<std::pair<Eigen::Matrix<Real, D, 1>, Real>> facet_quadrature() {
  if constexpr (D == 2) {
    const Real a = 0.5 - 0.5 * std::sqrt(0.6);
    return {{{a, 1 - a}, 5.0 / 18}, {{0.5, 0.5}, 8.0 / 18}, {{1 - a, a}, 5.0 / 18}};
  } else {
    std::vector<std::pair<Eigen::Matrix<Real, D, 1>, Real>> points;
    for (const auto& [a, weight] :
         {std::pair(0.445948490915965, 0.223381589678011), std::pair(0.091576213509771, 0.109951743655322)}) {
      points.push_back({{a, a, 1 - 2 * a}, weight});
      points.push_back({{a, 1 - 2 * a, a}, weight});
      points.push_back({{1 - 2 * a, a, a}, weight});
    }
    return points;
  }
}

/// This rank's share of the flow into the cavity [m^3/s] of the velocity that an inlet asks for. Local.
Real share_of_asked_flow(const Scene& scene, const BoundaryPart& part, Real time) {
  const InletSettings& inlet = scene.settings.inlets[part.index];
  Real flow = 0;
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId f : part.facets) {
      const auto points = facet_points<D>(scene.mesh, f);
      const Point<D> area_normal = facet_area_normal<D>(points);
      const Point<D> inward = -area_normal.normalized();
      for (const auto& [barycentric, weight] : facet_quadrature<D>()) {
        const Point<D> at = points * barycentric;
        std::array<Real, 3> place = {0, 0, 0};
        std::copy_n(at.data(), D, place.begin());
        const auto velocity = asked_velocity(inlet, place, inward.data(), D, time);
        const Real turn = scene.geometry == Geometry::axisymmetric ? 2 * std::numbers::pi * at[0] : 1;
        flow += turn * weight * area_normal.norm() * inward.dot(Eigen::Map<const Point<D>>(velocity.data()));
      }
    }
  });
  return flow;
}

/// That flow over all ranks. Collective.
Real asked_flow(const Scene& scene, const BoundaryPart& part, Real time) {
  Real share = 0;
  agree(scene.comm, [&] { share = share_of_asked_flow(scene, part, time); });
  return scene.comm.sum(share);
}

[[noreturn]] void refuse_blocked(const BoundaryPart& part) {
  throw InputError(fmt::format(
      "[{}]: no node of the gate can move, all lie on walls: refine the mesh to 2 or more elements across the gate",
      part.section));
}

/// The velocity that an inlet asks for at its nodes, in the directions that are still free, times the factor with which
/// their discrete flux is `flow` (into the cavity). Collective.
void feed(const Scene& scene, const BoundaryPart& part, Real flow, Real time, NodeConstraints& constraints) {
  const int dim = scene.mesh.dim;
  const InletSettings& inlet = scene.settings.inlets[part.index];
  std::vector<Real> velocity(static_cast<std::size_t>(scene.mesh.nodes()) * dim, 0);
  agree(scene.comm, [&] {
    for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
      if (!part.normals->holds(node)) continue;
      std::array<Real, 3> inward = {0, 0, 0};
      for (std::size_t c = 0; c < static_cast<std::size_t>(dim); ++c) inward[c] = -part.normals->normal(node)[c];
      const auto asked = asked_velocity(inlet, place_of(scene.mesh, node), inward.data(), dim, time);
      Real* at = velocity.data() + static_cast<std::size_t>(node) * dim;
      std::copy_n(asked.begin(), dim, at);
      constraints.project(node, at);
    }
  });
  const Real discrete = -outflow(scene, part.facets, velocity);
  if (flow != 0 && !(discrete * flow > 0)) refuse_blocked(part);
  const Real factor = flow != 0 ? flow / discrete : 0;
  for (Real& component : velocity) component *= factor;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    if (part.normals->holds(node)) {
      constraints.fix_velocity(node, velocity.data() + static_cast<std::size_t>(node) * dim);
    }
  }
}

/// Whether some node of a part can move along its normal. Collective.
bool can_move(const Scene& scene, const BoundaryPart& part, const NodeConstraints& constraints) {
  Real largest = 0;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    if (!part.normals->holds(node)) continue;
    std::array<Real, 3> normal = {0, 0, 0};
    std::copy_n(part.normals->normal(node).begin(), scene.mesh.dim, normal.begin());
    constraints.project(node, normal.data());
    for (const Real component : normal) largest = std::max(largest, std::abs(component));
  }
  return scene.comm.max(largest) > 1e-3;
}

ConditionKind kind_of(const InjectCase& settings, const BoundaryPart& part) {
  switch (part.kind) {
    case BoundaryPart::Kind::wall: {
      const WallSettings& wall = settings.walls[part.index];
      const bool sticks = wall.condition == WallSettings::Condition::no_slip && wall.only.empty();
      return sticks ? ConditionKind::no_slip : ConditionKind::symmetry;
    }
    case BoundaryPart::Kind::inlet:
    case BoundaryPart::Kind::vent:
      return ConditionKind::no_tangential;
    case BoundaryPart::Kind::symmetry:
      return ConditionKind::symmetry;
    case BoundaryPart::Kind::imposed:
      break;
  }
  const bool is_symmetry = settings.common.boundaries[part.index].type == BoundarySettings::Type::symmetry;
  return is_symmetry ? ConditionKind::symmetry : ConditionKind::velocity;
}

NodeConstraints impose(const Scene& scene, const std::vector<GateDrive>& drives, const StickingNodes& sticking,
                       Real time) {
  constexpr auto is_fed = [](const GateDrive& drive) { return drive.kind == GateDrive::Kind::velocity; };
  std::vector<BoundaryCondition> conditions;
  for (const BoundaryPart& part : scene.parts) {
    if (part.kind == BoundaryPart::Kind::inlet && is_fed(drives[part.index])) continue;
    BoundaryCondition& condition = conditions.emplace_back();
    condition.group = part.group;
    condition.kind = kind_of(scene.settings, part);
    if (condition.kind == ConditionKind::velocity) {
      condition.velocity = scene.settings.common.boundaries[part.index].imposed_velocity();
    }
  }
  NodeConstraints constraints = make_constraints(scene.comm, scene.mesh, scene.geometry, conditions, time);
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    if (sticking[static_cast<std::size_t>(node)] != 0) constraints.fix_velocity(node, at_rest.data());
  }
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (is_fed(drive)) feed(scene, *part, drive.value, time, constraints);
    if (drive.kind == GateDrive::Kind::flow_rate && drive.value != 0 && !can_move(scene, *part, constraints)) {
      refuse_blocked(*part);
    }
  }
  return constraints;
}

std::vector<FacetTraction> press(const Scene& scene, const std::vector<GateDrive>& drives, Real time) {
  std::vector<BoundaryLoad> loads;
  for (const BoundaryPart& part : scene.parts) {
    BoundaryLoad load;
    load.group = part.group;
    if (part.kind == BoundaryPart::Kind::vent) load.pressure = scene.settings.vents[part.index].pressure;
    if (part.kind == BoundaryPart::Kind::inlet && drives[part.index].kind == GateDrive::Kind::pressure) {
      load.pressure = Expression(drives[part.index].value);
    }
    if (part.kind == BoundaryPart::Kind::imposed) {
      const BoundarySettings& boundary = scene.settings.common.boundaries[part.index];
      load.pressure = boundary.pressure;
      load.traction = boundary.imposed_traction();
      if (!boundary.has_traction() && !boundary.pressure) continue;
    } else if (!load.pressure) {
      continue;
    }
    loads.push_back(std::move(load));
  }
  return make_tractions(scene.comm, scene.mesh, loads, time);
}

StokesLoads make_loads(const Scene& scene, const Mixture& mixture, const std::vector<GateDrive>& drives, Real time) {
  StokesLoads loads;
  loads.tractions = press(scene, drives, time);
  const auto dim = static_cast<std::size_t>(scene.mesh.dim);
  if (const auto& gravity = scene.settings.common.gravity) {
    loads.element_force.resize(static_cast<std::size_t>(scene.mesh.elements()) * dim);
    for (LocalId e = 0; e < scene.mesh.elements(); ++e) {
      const Real density = mixture.density(e);
      for (std::size_t c = 0; c < dim; ++c) {
        loads.element_force[static_cast<std::size_t>(e) * dim + c] = density * gravity->acceleration[c];
      }
    }
  }
  if (const auto& force = scene.settings.common.body_force) {
    const auto n = static_cast<std::size_t>(scene.mesh.nodes());
    loads.node_force.resize(n * dim);
    std::vector<Real> component(n);
    for (std::size_t c = 0; c < dim; ++c) {
      agree(scene.comm,
            [&] { force->force[c].evaluate_finite(scene.mesh.coordinates, scene.mesh.dim, time, component); });
      for (std::size_t node = 0; node < n; ++node) loads.node_force[node * dim + c] = component[node];
    }
  }
  return loads;
}

/// Whether some part of the boundary lets fluid out under a pressure, or air that [air] describes gives way.
bool has_opening(const Scene& scene, const std::vector<GateDrive>& drives) {
  if (scene.settings.common.air) return true;
  for (const BoundaryPart& part : scene.parts) {
    if (part.kind == BoundaryPart::Kind::vent) return true;
    if (part.kind == BoundaryPart::Kind::inlet && drives[part.index].kind == GateDrive::Kind::pressure) return true;
    if (part.kind != BoundaryPart::Kind::imposed) continue;
    const BoundarySettings& boundary = scene.settings.common.boundaries[part.index];
    if (boundary.type == BoundarySettings::Type::symmetry) continue;
    const ExpressionVector velocity = boundary.imposed_velocity();
    for (std::size_t c = 0; c < static_cast<std::size_t>(scene.mesh.dim); ++c) {
      if (!velocity[c]) return true;
    }
  }
  return false;
}

/// Where the case says what an inlet is to do: "case.ini:12: [inlet.gate] flow_rate".
std::string source_of(const InletSettings& inlet, const BoundaryPart& part) {
  if (inlet.pressure) return inlet.pressure->source();
  if (inlet.flow_rate) return inlet.flow_rate->source();
  if (inlet.velocity && inlet.velocity->speed) return inlet.velocity->speed->source();
  for (const auto& component : inlet.velocity ? inlet.velocity->vector : inlet.velocity_components) {
    if (component && !component->source().empty()) return component->source();
  }
  return "[" + part.section + "]";
}

void check_drive(const InletSettings& inlet, const BoundaryPart& part, const GateDrive& drive, Real time) {
  if (!std::isfinite(drive.value)) {
    throw InputError(fmt::format("{}: is not a number at {:.6g} s", source_of(inlet, part), time));
  }
  if (drive.kind != GateDrive::Kind::pressure && drive.value < 0) {
    throw InputError(fmt::format(
        "{}: asks for {:.4g} m^3/s at {:.6g} s, out of the cavity; an inlet lets fluid in: turn the sign, or let fluid "
        "out of a [vent.NAME]",
        source_of(inlet, part), drive.value, time));
  }
}

/// A closed cavity takes only as much as it gives.
void refuse_sealed(const Scene& scene, const std::vector<GateDrive>& drives, const NodeConstraints& constraints) {
  Real net = 0;
  Real gross = 0;
  std::string names;
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    net += drives[part->index].value;
    gross += std::abs(drives[part->index].value);
    names += (names.empty() ? "[" : ", [") + part->section + "]";
  }
  std::vector<Real> velocity(static_cast<std::size_t>(scene.mesh.nodes()) * scene.mesh.dim, 0);
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    constraints.impose(node, velocity.data() + static_cast<std::size_t>(node) * scene.mesh.dim);
  }
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::imposed)) {
    const Real out = outflow(scene, part->facets, velocity);
    net -= out;
    gross += std::abs(out);
  }
  if (gross > 0 && !names.empty() && std::abs(net) > 1e-3 * gross) {
    throw InputError(fmt::format(
        "the cavity is sealed: {} impose a flow of {:.4g} m^3/s and nothing lets fluid out; add a [vent.NAME] or give "
        "the inlet a pressure",
        names, net));
  }
}

}  // namespace

std::vector<GateDrive> asked_drives(const Scene& scene, Real time) {
  std::vector<GateDrive> drives(scene.settings.inlets.size());
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const InletSettings& inlet = scene.settings.inlets[part->index];
    GateDrive& drive = drives[part->index];
    if (inlet.pressure) {
      drive = {GateDrive::Kind::pressure, (*inlet.pressure)(at_rest, time)};
    } else if (inlet.flow_rate) {
      drive = {GateDrive::Kind::flow_rate, (*inlet.flow_rate)(at_rest, time)};
    } else {
      drive = {GateDrive::Kind::velocity, asked_flow(scene, *part, time)};
    }
    check_drive(inlet, *part, drive, time);
  }
  return drives;
}

FlowConditions make_conditions(const Scene& scene, const Mixture& mixture, const std::vector<GateDrive>& drives,
                               const StickingNodes& sticking, Real time) {
  FlowConditions conditions;
  conditions.loads = make_loads(scene, mixture, drives, time);  // first: mistakes of formulas before those of gates
  conditions.constraints = impose(scene, drives, sticking, time);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (drive.kind != GateDrive::Kind::flow_rate) continue;
    conditions.gates.push_back({part->facets, -drive.value});
    conditions.gate_inlets.push_back(part->index);
  }
  if (!has_opening(scene, drives)) refuse_sealed(scene, drives, conditions.constraints);
  return conditions;
}

}  // namespace malleus::inject
