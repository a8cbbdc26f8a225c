#include "forge/boundaries.hpp"

#include <cmath>

#include "base/error.hpp"
#include "mesh/simplex.hpp"
#include "parallel/agreement.hpp"

namespace malleus::forge {
namespace {

std::array<Real, 3> point_at(const Mesh& mesh, LocalId node) {
  const Real* x = mesh.point(node);
  return {x[0], x[1], mesh.dim == 3 ? x[2] : 0.0};
}

}  // namespace

Boundaries::Boundaries(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                       std::vector<BoundarySettings> settings, BodyLoads loads)
    : comm_(&comm), mesh_(&mesh), geometry_(geometry), settings_(std::move(settings)), body_loads_(std::move(loads)) {
  mesh_changed();
}

void Boundaries::mesh_changed() {
  is_free_.assign(mesh_->group_names.size() + 1, 1);
  nodes_.clear();
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    const auto group = static_cast<std::size_t>(group_of(i) + 1);
    check(group > 0, "the groups of boundaries are in the mesh");
    const bool symmetric = settings_[i].type == BoundarySettings::Type::symmetry;
    if (symmetric || settings_[i].has_velocity()) is_free_[group] = 0;
    nodes_.push_back(nodes_of(i));
  }
  node_body_.assign(static_cast<std::size_t>(mesh_->nodes()), -1);
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    for (const LocalId node : mesh_->nodes_of_element(e)) {
      node_body_[static_cast<std::size_t>(node)] = mesh_->element_region[static_cast<std::size_t>(e)];
    }
  }
}

std::vector<LocalId> Boundaries::nodes_of(std::size_t boundary) const {
  std::vector<Real> is_on(static_cast<std::size_t>(mesh_->nodes()), 0.0);
  const int group = group_of(boundary);
  for (LocalId facet = 0; facet < mesh_->exterior_facets; ++facet) {
    if (mesh_->facet_group[static_cast<std::size_t>(facet)] != group) continue;
    for (const LocalId node : mesh_->nodes_of_facet(facet)) is_on[static_cast<std::size_t>(node)] = 1;
  }
  mesh_->node_halo.max_to_owners(is_on, 1);
  mesh_->node_halo.update_copies(is_on, 1);
  std::vector<LocalId> nodes;
  for (LocalId node = 0; node < mesh_->nodes(); ++node) {
    if (is_on[static_cast<std::size_t>(node)] > 0) nodes.push_back(node);
  }
  return nodes;
}

std::array<Real, 3> Boundaries::velocity_at(std::size_t boundary, const Real* point, Real time) const {
  const ExpressionVector components = settings_[boundary].imposed_velocity();
  std::array<Real, 3> place = {point[0], point[1], mesh_->dim == 3 ? point[2] : 0.0};
  std::array<Real, 3> velocity = {0, 0, 0};
  for (std::size_t c = 0; c < static_cast<std::size_t>(mesh_->dim); ++c) {
    if (components[c]) velocity[c] = components[c]->finite_at(place, time);
  }
  return velocity;
}

NodeConstraints Boundaries::constraints(Real time) const {
  std::vector<BoundaryCondition> conditions;
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    const std::int32_t group = group_of(i);
    if (settings_[i].type == BoundarySettings::Type::symmetry) {
      conditions.push_back({group, ConditionKind::symmetry, {}});
    } else if (settings_[i].has_velocity()) {
      conditions.push_back({group, ConditionKind::velocity, settings_[i].imposed_velocity()});
    }
  }
  NodeConstraints constraints = make_constraints(*comm_, *mesh_, geometry_, conditions, time);
  add_rigid_bodies(constraints, time);
  return constraints;
}

/// A rigid body has the mean of the velocities imposed on its nodes.
void Boundaries::add_rigid_bodies(NodeConstraints& constraints, Real time) const {
  for (std::size_t region = 0; region < body_loads_.is_rigid.size(); ++region) {
    if (body_loads_.is_rigid[region] == 0) continue;
    std::array<Real, 4> sums = {0, 0, 0, 0};
    agree(*comm_, [&] {
      for (std::size_t i = 0; i < settings_.size(); ++i) {
        if (settings_[i].has_velocity()) add_velocities(i, static_cast<std::int32_t>(region), time, sums);
      }
    });
    comm_->sum_in_place(sums);
    std::array<Real, 3> velocity = {0, 0, 0};
    for (std::size_t c = 0; c < 3 && sums[3] > 0; ++c) velocity[c] = sums[c] / sums[3];
    for (LocalId node = 0; node < mesh_->nodes(); ++node) {
      if (node_body_[static_cast<std::size_t>(node)] != static_cast<std::int32_t>(region)) continue;
      constraints.fix_velocity(node, velocity.data());
      constraints.set_velocity(node, velocity.data());
      constraints.fix_pressure(node);
    }
  }
}

/// Velocities imposed by a boundary on this rank's owned nodes of a region (-1: of any), and their count.
void Boundaries::add_velocities(std::size_t boundary, std::int32_t region, Real time, std::array<Real, 4>& sums) const {
  for (const LocalId node : nodes_[boundary]) {
    if (node >= mesh_->owned_nodes()) break;
    if (region >= 0 && node_body_[static_cast<std::size_t>(node)] != region) continue;
    const std::array<Real, 3> velocity = velocity_at(boundary, mesh_->point(node), time);
    for (std::size_t c = 0; c < 3; ++c) sums[c] += velocity[c];
    sums[3] += 1;
  }
}

bool Boundaries::has_loads() const {
  bool any = !body_loads_.gravity.empty() || !body_loads_.force.empty();
  for (const BoundarySettings& boundary : settings_) any = any || boundary.has_traction() || boundary.pressure;
  return any;
}

StokesLoads Boundaries::loads(Real time) const {
  StokesLoads loads;
  const int dim = mesh_->dim;
  if (!body_loads_.gravity.empty()) {
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      const auto& force =
          body_loads_.gravity[static_cast<std::size_t>(mesh_->element_region[static_cast<std::size_t>(e)])];
      loads.element_force.insert(loads.element_force.end(), force.begin(), force.begin() + dim);
    }
  }
  agree(*comm_, [&] {
    if (body_loads_.force.empty()) return;
    for (LocalId node = 0; node < mesh_->nodes(); ++node) {
      for (std::size_t c = 0; c < static_cast<std::size_t>(dim); ++c) {
        loads.node_force.push_back(body_loads_.force[c].finite_at(point_at(*mesh_, node), time));
      }
    }
  });
  std::vector<BoundaryLoad> tractions;
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    if (!settings_[i].has_traction() && !settings_[i].pressure) continue;
    tractions.push_back({group_of(i), settings_[i].imposed_traction(), settings_[i].pressure});
  }
  loads.tractions = make_tractions(*comm_, *mesh_, tractions, time);
  return loads;
}

Real Boundaries::largest_speed(Real time) const {
  Real largest = 0;
  agree(*comm_, [&] {
    for (std::size_t i = 0; i < settings_.size(); ++i) {
      if (!settings_[i].has_velocity()) continue;
      for (const LocalId node : nodes_[i]) {
        const auto velocity = velocity_at(i, mesh_->point(node), time);
        largest = std::max(largest, std::hypot(velocity[0], velocity[1], velocity[2]));
      }
    }
  });
  return comm_->max(largest);
}

std::array<Real, 3> Boundaries::mean_velocity(std::size_t i, Real time) const {
  std::array<Real, 4> sums = {0, 0, 0, 0};
  agree(*comm_, [&] { add_velocities(i, -1, time, sums); });
  comm_->sum_in_place(sums);
  std::array<Real, 3> mean = {0, 0, 0};
  for (std::size_t c = 0; c < 3 && sums[3] > 0; ++c) mean[c] = sums[c] / sums[3];
  return mean;
}

std::array<Real, 3> Boundaries::force(std::size_t i, std::span<const Real> reactions) const {
  const auto dim = static_cast<std::size_t>(mesh_->dim);
  const ExpressionVector components = settings_[i].imposed_velocity();
  std::array<Real, 3> sum = {0, 0, 0};
  for (const LocalId node : nodes_[i]) {
    if (node >= mesh_->owned_nodes()) break;
    for (std::size_t c = 0; c < dim; ++c) {
      bool is_mine = components[c].has_value();
      for (std::size_t j = 0; j < i && is_mine; ++j) {
        const bool imposes = settings_[j].imposed_velocity()[c].has_value();
        is_mine = !(imposes && std::binary_search(nodes_[j].begin(), nodes_[j].end(), node));
      }
      if (is_mine) sum[c] -= reactions[static_cast<std::size_t>(node) * dim + c];
    }
  }
  comm_->sum_in_place(sum);
  return sum;
}

bool Boundaries::is_held(std::int32_t region) const {
  bool held = false;
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    if (is_free_[static_cast<std::size_t>(group_of(i) + 1)] != 0) continue;
    for (const LocalId node : nodes_[i]) held = held || node_body_[static_cast<std::size_t>(node)] == region;
  }
  return comm_->any(held);
}

}  // namespace malleus::forge
