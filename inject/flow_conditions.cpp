#include "inject/flow_conditions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"

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
    const Real speed = (*inlet.velocity->speed)(place, time);
    for (int c = 0; c < dim; ++c) velocity[static_cast<std::size_t>(c)] = speed * inward[c];
    return velocity;
  }
  const ExpressionVector& components = inlet.velocity ? inlet.velocity->vector : inlet.velocity_components;
  for (std::size_t c = 0; c < static_cast<std::size_t>(dim); ++c) {
    if (components[c]) velocity[c] = (*components[c])(place, time);
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

/// Flow into the cavity [m^3/s] of the velocity that an inlet asks for. Collective.
Real asked_flow(const Scene& scene, const BoundaryPart& part, Real time) {
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
  return scene.comm.sum(flow);
}

/// Puts all constraints together, in the order of precedence.
class ConstraintBuilder {
 public:
  ConstraintBuilder(const Scene& scene, Real time)
      : scene_(scene), time_(time), constraints_(scene.mesh.dim, scene.mesh.nodes()) {}

  void stick(const BoundaryPart& part, const StickingNodes* only) {
    for_nodes(part, [&](LocalId node) {
      if (only == nullptr || (*only)[static_cast<std::size_t>(node)] != 0) {
        constraints_.fix_velocity(node, at_rest.data());
      } else {
        fix_normals(part, node);
      }
    });
  }
  /// Nothing passes through: slip walls and planes of symmetry.
  void close(const BoundaryPart& part) {
    for_nodes(part, [&](LocalId node) { fix_normals(part, node); });
  }
  /// No velocity along the surface: gates and vents under a normal traction.
  void forbid_tangential(const BoundaryPart& part) {
    for_nodes(part, [&](LocalId node) {
      for (int k = 1; k < dim(); ++k) constraints_.fix_direction(node, part.normals.direction(node, k), at_rest.data());
    });
  }
  void impose(const BoundaryPart& part) {
    const BoundarySettings& boundary = scene_.settings.common.boundaries[part.index];
    if (boundary.type == BoundarySettings::Type::symmetry) return close(part);
    const ExpressionVector velocity = boundary.imposed_velocity();
    for_nodes(part, [&](LocalId node) {
      for (int c = 0; c < dim(); ++c) {
        const auto& component = velocity[static_cast<std::size_t>(c)];
        if (!component) continue;
        std::array<Real, 3> direction = {0, 0, 0};
        std::array<Real, 3> value = {0, 0, 0};
        direction[static_cast<std::size_t>(c)] = 1;
        value[static_cast<std::size_t>(c)] = (*component)(place_of(scene_.mesh, node), time_);
        constraints_.fix_direction(node, direction.data(), value.data());
      }
    });
  }
  /// The velocity that the inlet asks for at its nodes that are still free, times the factor with which their discrete
  /// flux is `flow` (into the cavity). Collective.
  void feed(const BoundaryPart& part, Real flow) {
    const InletSettings& inlet = scene_.settings.inlets[part.index];
    const auto velocity_at = [&](LocalId node) {
      std::array<Real, 3> inward = {0, 0, 0};
      for (int c = 0; c < dim(); ++c) inward[static_cast<std::size_t>(c)] = -part.normals.direction(node, 0)[c];
      return asked_velocity(inlet, place_of(scene_.mesh, node), inward.data(), dim(), time_);
    };
    Real discrete = 0;
    for_nodes(part, [&](LocalId node) {
      if (node >= scene_.mesh.owned_nodes()) return;
      auto velocity = velocity_at(node);
      constraints_.project(node, velocity.data());
      const Real* normal = part.normals.weighted.data() + static_cast<std::size_t>(node) * dim();
      for (int c = 0; c < dim(); ++c) discrete -= velocity[static_cast<std::size_t>(c)] * normal[c];
    });
    discrete = scene_.comm.sum(discrete);
    if (flow != 0 && !(discrete * flow > 0)) {
      throw InputError(fmt::format(
          "[{}] velocity: no node of the gate can move, all lie on walls: refine the mesh to 2 or more elements across "
          "the gate",
          part.section));
    }
    const Real factor = flow != 0 ? flow / discrete : 0;
    for_nodes(part, [&](LocalId node) {
      auto velocity = velocity_at(node);
      for (Real& component : velocity) component *= factor;
      constraints_.fix_velocity(node, velocity.data());
    });
  }

  NodeConstraints take() { return std::move(constraints_); }

 private:
  int dim() const { return scene_.mesh.dim; }
  template <class Action>
  void for_nodes(const BoundaryPart& part, Action action) {
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (part.normals.is_on(node)) action(node);
    }
  }
  void fix_normals(const BoundaryPart& part, LocalId node) {
    for (int k = 0; k < part.normals.count[static_cast<std::size_t>(node)]; ++k) {
      constraints_.fix_direction(node, part.normals.direction(node, k), at_rest.data());
    }
  }

  const Scene& scene_;
  Real time_;
  NodeConstraints constraints_;
};

NodeConstraints make_constraints(const Scene& scene, const std::vector<GateDrive>& drives,
                                 const StickingNodes& sticking, Real time) {
  using Kind = BoundaryPart::Kind;
  ConstraintBuilder builder(scene, time);
  for (const BoundaryPart* part : scene.parts_of(Kind::wall)) {
    const WallSettings& wall = scene.settings.walls[part->index];
    if (wall.condition == WallSettings::Condition::no_slip)
      builder.stick(*part, wall.only.empty() ? nullptr : &sticking);
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::wall)) {
    if (scene.settings.walls[part->index].condition == WallSettings::Condition::slip) builder.close(*part);
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::imposed)) {
    if (scene.settings.common.boundaries[part->index].type == BoundarySettings::Type::imposed) builder.impose(*part);
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (drive.kind == GateDrive::Kind::velocity) {
      builder.feed(*part, drive.value);
    } else {
      builder.forbid_tangential(*part);
    }
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::vent)) builder.forbid_tangential(*part);
  for (const BoundaryPart* part : scene.parts_of(Kind::imposed)) {
    if (scene.settings.common.boundaries[part->index].type == BoundarySettings::Type::symmetry) builder.impose(*part);
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::symmetry)) builder.close(*part);
  return builder.take();
}

/// -p n on every facet of a part.
void press(const Scene& scene, const BoundaryPart& part, const Expression& pressure, Real time,
           std::vector<FacetTraction>& tractions) {
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId f : part.facets) {
      const Point<D> normal = facet_area_normal<D>(facet_points<D>(scene.mesh, f)).normalized();
      FacetTraction traction;
      traction.facet = f;
      for (int i = 0; i < D; ++i) {
        const LocalId node = scene.mesh.nodes_of_facet(f)[static_cast<std::size_t>(i)];
        const Real p = pressure(place_of(scene.mesh, node), time);
        for (int c = 0; c < D; ++c) traction.traction[static_cast<std::size_t>(i * D + c)] = -p * normal[c];
      }
      tractions.push_back(traction);
    }
  });
}

void pull(const Scene& scene, const BoundaryPart& part, Real time, std::vector<FacetTraction>& tractions) {
  const BoundarySettings& boundary = scene.settings.common.boundaries[part.index];
  if (boundary.pressure) press(scene, part, *boundary.pressure, time, tractions);
  if (!boundary.has_traction()) return;
  const auto force = boundary.imposed_traction();
  const int dim = scene.mesh.dim;
  for (const LocalId f : part.facets) {
    FacetTraction traction;
    traction.facet = f;
    for (int i = 0; i < dim; ++i) {
      const LocalId node = scene.mesh.nodes_of_facet(f)[static_cast<std::size_t>(i)];
      for (int c = 0; c < dim; ++c) {
        traction.traction[static_cast<std::size_t>(i * dim + c)] =
            force[static_cast<std::size_t>(c)](place_of(scene.mesh, node), time);
      }
    }
    tractions.push_back(traction);
  }
}

StokesLoads make_loads(const Scene& scene, const Mixture& mixture, const std::vector<GateDrive>& drives, Real time) {
  using Kind = BoundaryPart::Kind;
  StokesLoads loads;
  for (const BoundaryPart* part : scene.parts_of(Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (drive.kind == GateDrive::Kind::pressure) press(scene, *part, Expression(drive.value), time, loads.tractions);
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::vent)) {
    press(scene, *part, scene.settings.vents[part->index].pressure, time, loads.tractions);
  }
  for (const BoundaryPart* part : scene.parts_of(Kind::imposed)) pull(scene, *part, time, loads.tractions);
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
      force->force[c].evaluate(scene.mesh.coordinates, scene.mesh.dim, time, component);
      for (std::size_t node = 0; node < n; ++node) loads.node_force[node * dim + c] = component[node];
    }
  }
  return loads;
}

/// Whether some part of the boundary lets fluid out under a pressure.
bool has_opening(const Scene& scene, const std::vector<GateDrive>& drives) {
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

std::vector<char> sticking_walls(const Scene& scene) {
  std::vector<char> sticks(static_cast<std::size_t>(scene.mesh.nodes()), 0);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::wall)) {
    if (scene.settings.walls[part->index].condition != WallSettings::Condition::no_slip) continue;
    for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
      if (part->normals.is_on(node)) sticks[static_cast<std::size_t>(node)] = 1;
    }
  }
  return sticks;
}

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
    if (!std::isfinite(drive.value)) {
      throw InputError(fmt::format("[{}]: what is asked for at {:.6g} s is not a number", part->section, time));
    }
  }
  return drives;
}

FlowConditions make_conditions(const Scene& scene, const Mixture& mixture, const std::vector<GateDrive>& drives,
                               const StickingNodes& sticking, Real time) {
  FlowConditions conditions;
  conditions.constraints = make_constraints(scene, drives, sticking, time);
  conditions.loads = make_loads(scene, mixture, drives, time);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const GateDrive& drive = drives[part->index];
    if (drive.kind != GateDrive::Kind::flow_rate) continue;
    conditions.gates.push_back({part->facets, -drive.value});
    conditions.gate_inlets.push_back(part->index);
  }
  if (!has_opening(scene, drives)) {
    conditions.pressure_is_free = true;
    refuse_sealed(scene, drives, conditions.constraints);
  }
  return conditions;
}

}  // namespace malleus::inject
