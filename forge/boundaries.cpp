#include "forge/boundaries.hpp"

#include <cmath>

#include "base/error.hpp"
#include "forge/free_surface.hpp"

namespace malleus::forge {
namespace {

/// Facets of one symmetry plane differ in their normals by rounding alone; planes differ by more than this (rad).
constexpr Real plane_angle = 0.05;
/// A constraint of a node as it travels to copies: count, three directions, velocity, pressure flag.
constexpr int packed_size = 14;

std::array<Real, 3> point_at(const Mesh& mesh, LocalId node) {
  const Real* x = mesh.point(node);
  return {x[0], x[1], mesh.dim == 3 ? x[2] : 0.0};
}

void pack(const NodeConstraints& constraints, LocalId node, Real* packed) {
  const int dim = constraints.dim();
  const int fixed = constraints.fixed_directions(node);
  packed[0] = fixed;
  const auto directions = constraints.directions(node);
  for (int i = 0; i < fixed * dim; ++i) packed[1 + i] = directions[static_cast<std::size_t>(i)];
  std::array<Real, 3> velocity = {0, 0, 0};
  constraints.impose(node, velocity.data());
  for (int c = 0; c < dim; ++c) packed[10 + c] = velocity[static_cast<std::size_t>(c)];
  packed[13] = constraints.is_pressure_fixed(node) ? 1 : 0;
}

void unpack(const Real* packed, LocalId node, NodeConstraints& constraints) {
  const int dim = constraints.dim();
  for (int i = 0; i < static_cast<int>(packed[0]); ++i) {
    constraints.fix_direction(node, packed + 1 + i * dim, packed + 10);
  }
  if (packed[13] != 0) constraints.fix_pressure(node);
}

/// Copies get the constraints of their owners.
void share(const Mesh& mesh, NodeConstraints& constraints) {
  std::vector<Real> packed(static_cast<std::size_t>(mesh.nodes()) * packed_size, 0.0);
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    pack(constraints, node, packed.data() + static_cast<std::size_t>(node) * packed_size);
  }
  mesh.node_halo.update_copies(packed, packed_size);
  for (LocalId node = mesh.owned_nodes(); node < mesh.nodes(); ++node) {
    unpack(packed.data() + static_cast<std::size_t>(node) * packed_size, node, constraints);
  }
}

}  // namespace

Boundaries::Boundaries(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                       std::vector<BoundarySettings> settings, BodyLoads loads)
    : comm_(&comm), mesh_(&mesh), geometry_(geometry), settings_(std::move(settings)), body_loads_(std::move(loads)) {
  mesh_changed();
}

void Boundaries::mesh_changed() {
  is_free_.assign(mesh_->group_names.size() + 1, 1);
  std::vector<char> is_symmetry(is_free_.size(), 0);
  nodes_.clear();
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    const auto group = static_cast<std::size_t>(group_of(i) + 1);
    check(group > 0, "the groups of boundaries are in the mesh");
    const bool symmetric = settings_[i].type == BoundarySettings::Type::symmetry;
    if (symmetric) is_symmetry[group] = 1;
    if (symmetric || settings_[i].has_velocity()) is_free_[group] = 0;
    nodes_.push_back(nodes_of(i));
  }
  node_body_.assign(static_cast<std::size_t>(mesh_->nodes()), -1);
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    for (const LocalId node : mesh_->nodes_of_element(e)) {
      node_body_[static_cast<std::size_t>(node)] = mesh_->element_region[static_cast<std::size_t>(e)];
    }
  }
  symmetry_.clear();
  const FreeSurface planes(*comm_, *mesh_, geometry_, is_symmetry);
  for (std::size_t i = 0; i < planes.nodes().size(); ++i) {
    auto& [node, normals] = symmetry_.emplace_back();
    node = planes.nodes()[i];
    for (const Vector& share : planes.shares(i)) {
      const Vector normal = share.normalized();
      normals.push_back({normal[0], normal[1], normal[2]});
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
    if (components[c]) velocity[c] = (*components[c])(place, time);
  }
  return velocity;
}

NodeConstraints Boundaries::constraints(Real time) const {
  NodeConstraints constraints(mesh_->dim, mesh_->nodes());
  add_rigid_bodies(constraints, time);
  add_symmetry(constraints);
  add_velocities(constraints, time);
  share(*mesh_, constraints);
  return constraints;
}

void Boundaries::add_symmetry(NodeConstraints& constraints) const {
  const std::array<Real, 3> at_rest = {0, 0, 0};
  for (const auto& [node, normals] : symmetry_) {
    for (const auto& normal : normals) constraints.fix_direction(node, normal.data(), at_rest.data(), plane_angle);
  }
  if (geometry_ != Geometry::axisymmetric) return;
  const std::array<Real, 3> radial = {1, 0, 0};
  for (LocalId node = 0; node < mesh_->owned_nodes(); ++node) {
    if (!(mesh_->point(node)[0] > 0)) constraints.fix_direction(node, radial.data(), at_rest.data());
  }
}

void Boundaries::add_velocities(NodeConstraints& constraints, Real time) const {
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    if (!settings_[i].has_velocity()) continue;
    const ExpressionVector components = settings_[i].imposed_velocity();
    for (const LocalId node : nodes_[i]) {
      if (node >= mesh_->owned_nodes()) break;
      const std::array<Real, 3> velocity = velocity_at(i, mesh_->point(node), time);
      for (std::size_t c = 0; c < static_cast<std::size_t>(mesh_->dim); ++c) {
        std::array<Real, 3> axis = {0, 0, 0};
        axis[c] = 1;
        if (components[c]) constraints.fix_direction(node, axis.data(), velocity.data());
      }
    }
  }
}

void Boundaries::add_rigid_bodies(NodeConstraints& constraints, Real time) const {
  for (std::size_t region = 0; region < body_loads_.is_rigid.size(); ++region) {
    if (body_loads_.is_rigid[region] == 0) continue;
    std::array<Real, 4> sums = {0, 0, 0, 0};
    for (std::size_t i = 0; i < settings_.size(); ++i) {
      if (!settings_[i].has_velocity()) continue;
      for (const LocalId node : nodes_[i]) {
        if (node >= mesh_->owned_nodes() || node_body_[static_cast<std::size_t>(node)] != static_cast<int>(region))
          continue;
        const std::array<Real, 3> velocity = velocity_at(i, mesh_->point(node), time);
        for (std::size_t c = 0; c < 3; ++c) sums[c] += velocity[c];
        sums[3] += 1;
      }
    }
    comm_->sum_in_place(sums);
    std::array<Real, 3> velocity = {0, 0, 0};
    for (std::size_t c = 0; c < 3 && sums[3] > 0; ++c) velocity[c] = sums[c] / sums[3];
    for (LocalId node = 0; node < mesh_->owned_nodes(); ++node) {
      if (node_body_[static_cast<std::size_t>(node)] != static_cast<int>(region)) continue;
      constraints.fix_velocity(node, velocity.data());
      constraints.fix_pressure(node);
    }
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
  if (!body_loads_.force.empty()) {
    for (LocalId node = 0; node < mesh_->nodes(); ++node) {
      for (int c = 0; c < dim; ++c) {
        loads.node_force.push_back(body_loads_.force[static_cast<std::size_t>(c)](point_at(*mesh_, node), time));
      }
    }
  }
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    const BoundarySettings& boundary = settings_[i];
    if (!boundary.has_traction() && !boundary.pressure) continue;
    const std::array<Expression, 3> imposed = boundary.imposed_traction();
    const int group = group_of(i);
    with_dim(dim, [&](auto d) {
      constexpr int D = decltype(d)::value;
      for (LocalId facet = 0; facet < mesh_->exterior_facets; ++facet) {
        if (mesh_->facet_group[static_cast<std::size_t>(facet)] != group) continue;
        const Point<D> normal = facet_area_normal<D>(facet_points<D>(*mesh_, facet)).normalized();
        FacetTraction traction;
        traction.facet = facet;
        for (int k = 0; k < D; ++k) {
          const auto place = point_at(*mesh_, mesh_->nodes_of_facet(facet)[static_cast<std::size_t>(k)]);
          const Real pressure = boundary.pressure ? (*boundary.pressure)(place, time) : 0;
          for (int c = 0; c < D; ++c) {
            traction.traction[static_cast<std::size_t>(k * D + c)] =
                imposed[static_cast<std::size_t>(c)](place, time) - pressure * normal[c];
          }
        }
        loads.tractions.push_back(traction);
      }
    });
  }
  return loads;
}

bool Boundaries::is_closed() const {
  std::vector<char> is_held(is_free_.size(), 0);
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    const ExpressionVector components = settings_[i].imposed_velocity();
    bool all = settings_[i].has_velocity();
    for (std::size_t c = 0; c < static_cast<std::size_t>(mesh_->dim); ++c) all = all && components[c].has_value();
    if (all || settings_[i].type == BoundarySettings::Type::symmetry) {
      is_held[static_cast<std::size_t>(group_of(i) + 1)] = 1;
    }
  }
  bool closed = true;
  for (LocalId facet = 0; facet < mesh_->exterior_facets; ++facet) {
    const auto region = static_cast<std::size_t>(
        mesh_->element_region[static_cast<std::size_t>(mesh_->facet_element[static_cast<std::size_t>(facet)])]);
    const bool held = is_held[static_cast<std::size_t>(mesh_->facet_group[static_cast<std::size_t>(facet)] + 1)] != 0;
    closed = closed && (held || body_loads_.is_rigid[region] != 0);
  }
  return comm_->all(closed);
}

Real Boundaries::largest_speed(Real time) const {
  Real largest = 0;
  for (std::size_t i = 0; i < settings_.size(); ++i) {
    if (!settings_[i].has_velocity()) continue;
    for (const LocalId node : nodes_[i]) {
      const auto velocity = velocity_at(i, mesh_->point(node), time);
      largest = std::max(largest, std::hypot(velocity[0], velocity[1], velocity[2]));
    }
  }
  return comm_->max(largest);
}

std::array<Real, 3> Boundaries::mean_velocity(std::size_t i, Real time) const {
  std::array<Real, 4> sums = {0, 0, 0, 0};
  for (const LocalId node : nodes_[i]) {
    if (node >= mesh_->owned_nodes()) break;
    const auto velocity = velocity_at(i, mesh_->point(node), time);
    for (std::size_t c = 0; c < 3; ++c) sums[c] += velocity[c];
    sums[3] += 1;
  }
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
