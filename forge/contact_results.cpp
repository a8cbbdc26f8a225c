#include <cmath>

#include "forge/contact_flow.hpp"

namespace malleus::forge {
namespace {

/// Limits of friction have settled where they change by less than this share of all friction.
constexpr Real settled_friction = 1e-3;
constexpr int most_friction_passes = 6;
/// Gaps below this share of an edge let heat through.
constexpr Real closed_gap = 1e-3;
/// Share of the contact area that must come to hold for a pass with its friction in the same increment.
constexpr Real many_points = 0.05;

}  // namespace

const FrictionSpec& ContactFlow::friction_of(int opponent) const {
  const auto i = static_cast<std::size_t>(opponent);
  return i < scene_.tools.size() ? scene_.tools[i].friction() : scene_.pairs[i - scene_.tools.size()].friction;
}

bool ContactFlow::has_limited_friction() const {
  bool limited = false;
  for (int i = 0; i < static_cast<int>(scene_.tools.size() + scene_.pairs.size()); ++i) {
    limited = limited || (friction_of(i).coefficient > 0 && friction_of(i).law != FrictionLaw::norton);
  }
  return limited;
}

/// eta gamma of the elements around a node, weighted with their volumes. Zero before the first solution.
std::vector<Real> ContactFlow::nodal_shear_stress() const {
  const Mesh& mesh = scene_.mesh;
  const auto viscosity = std::as_const(scene_.fields)[field_name::viscosity].values();
  const auto rate = std::as_const(scene_.fields)[field_name::strain_rate].values();
  std::vector<Real> sums(static_cast<std::size_t>(mesh.nodes()) * 2, 0.0);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      const Real volume = simplex_volume<D>(simplex_points<D>(mesh, e));
      for (const LocalId node : mesh.nodes_of_element(e)) {
        sums[static_cast<std::size_t>(node) * 2] += volume * viscosity[i] * std::sqrt(3.0) * rate[i];
        sums[static_cast<std::size_t>(node) * 2 + 1] += volume;
      }
    }
  });
  mesh.node_halo.add_to_owners(sums, 2);
  mesh.node_halo.update_copies(sums, 2);
  std::vector<Real> stress(static_cast<std::size_t>(mesh.nodes()));
  for (std::size_t i = 0; i < stress.size(); ++i) stress[i] = sums[2 * i + 1] > 0 ? sums[2 * i] / sums[2 * i + 1] : 0;
  return stress;
}

Real ContactFlow::measure_contacts(const Stage& stage, const FreeSurface& surface) {
  const auto components = static_cast<std::size_t>(scene_.dim() + 1);
  const NodeSpace& space = *contact_space_;
  std::vector<Real> unknowns(static_cast<std::size_t>(space.nodes()) * components, 0.0);
  std::copy_n(state_.nodes.begin(), static_cast<std::size_t>(space.owned()) * components, unknowns.begin());
  space.halo().update_copies(unknowns, scene_.dim() + 1);

  const Real effective_step = stage.displacement.step * stage.displacement.now;
  tractions_.clear();
  slips_.clear();
  gaps_.clear();
  memory_.clear();
  Real deepest = 0;        // m
  Real deepest_share = 0;  // of an edge
  GlobalId active = 0;
  for (const ContactPoint& point : contact_.points()) {
    const Vector& slip = slips_.emplace_back(contact_.slip(point, space, unknowns));
    const ContactTraction& traction = tractions_.emplace_back(ContactTerm::traction(point, slip));
    gaps_.push_back(-effective_step * (point.normal.offset - point.normal.normal.dot(slip)));
    if (!(traction.pressure > 0)) continue;
    ++active;
    memory_.push_back({point.slave, point.opponent, point.normal.normal, point.normal.multiplier, traction.pressure});
    const auto body = static_cast<std::size_t>(surface.body_of_node(point.slave));
    deepest = std::max(deepest, -gaps_.back());
    deepest_share = std::max(deepest_share, std::abs(gaps_.back()) / scene_.body_scales[body].edge);
  }
  report_.contacts = static_cast<int>(scene_.comm->sum(active));
  report_.max_penetration = scene_.comm->max(deepest);
  return scene_.comm->max(deepest_share);
}

bool ContactFlow::update_contacts(const Stage& stage, const FreeSurface& surface, int pass) {
  const Real deepest_share = measure_contacts(stage, surface);
  bool again = false;
  if (scene_.penalty.augmented && deepest_share > scene_.penalty.penetration) {
    for (std::size_t i = 0; i < tractions_.size(); ++i) {
      contact_.points()[i].normal.multiplier = tractions_[i].pressure;
    }
    for (ContactMemory& memory : memory_) memory.multiplier = memory.pressure;
    again = true;
  }
  again = update_rubbing(pass) || again;
  if (has_limited_friction() && pass < most_friction_passes) again = update_friction(surface) || again;
  return again;
}

/// Points that hold rub, others do not. Those that no longer hold lose their friction at once; those that came to hold
/// gain it after the first pass where they are many (a first contact), else in the next increment: friction that sticks
/// makes each change of the set a new problem, and the few nodes at the border of a contact would change it for ever.
bool ContactFlow::update_rubbing(int pass) {
  std::array<Real, 3> areas = {0, 0, 0};  // of points that hold, that lost their friction, that could gain some
  const auto changes = [&](std::size_t i) {
    const ContactPoint& point = contact_.points()[i];
    return point.friction.scale > 0 && point.rubs != (tractions_[i].pressure > 0);
  };
  for (std::size_t i = 0; i < tractions_.size(); ++i) {
    ContactPoint& point = contact_.points()[i];
    if (tractions_[i].pressure > 0) areas[0] += point.area;
    if (!changes(i)) continue;
    areas[point.rubs ? 1 : 2] += point.area;
    if (point.rubs) point.rubs = false;
  }
  scene_.comm->sum_in_place(areas);
  const bool gains = pass == 0 && areas[2] > many_points * areas[0];
  for (std::size_t i = 0; gains && i < tractions_.size(); ++i) {
    if (changes(i)) contact_.points()[i].rubs = true;
  }
  return areas[1] > 0 || gains;
}

bool ContactFlow::update_friction(const FreeSurface& surface) {
  // Stresses of the state, through the fields that nodal_shear_stress() reads.
  operator_->update_viscosity(state_);
  auto viscosity = scene_.fields[field_name::viscosity].values();
  auto rate = scene_.fields[field_name::strain_rate].values();
  for (std::size_t e = 0; e < viscosity.size(); ++e) {
    viscosity[e] = operator_->viscosity()[e];
    rate[e] = operator_->shear_rate()[e] / std::sqrt(3.0);
  }
  const std::vector<Real> shear_stress = nodal_shear_stress();
  std::array<Real, 2> sums = {0, 0};
  for (std::size_t i = 0; i < contact_.points().size(); ++i) {
    ContactPoint& point = contact_.points()[i];
    const FrictionSpec& spec = friction_of(point.opponent);
    if (!(spec.coefficient > 0) || spec.law == FrictionLaw::norton) continue;
    const auto body = static_cast<std::size_t>(surface.body_of_node(point.slave));
    const FrictionTerm term =
        friction_term(spec, scene_.body_scales[body].consistency, shear_stress[static_cast<std::size_t>(point.slave)],
                      tractions_[i].pressure, scene_.contact.slip_scale);
    sums[0] += point.area * std::abs(term.scale - point.friction.scale);
    sums[1] += point.area * term.scale;
    point.friction = term;
  }
  scene_.comm->sum_in_place(sums);
  return sums[0] > settled_friction * sums[1];
}

Real ContactFlow::surprise(const Stage& stage, const FreeSurface& surface) {
  std::size_t next = 0;  // in the contact points, which are sorted by slave
  Real worst = 0;
  for (const LocalId node : surface.nodes()) {
    const auto body = static_cast<std::size_t>(surface.body_of_node(node));
    Real foreseen = 0;
    for (; next < contact_.points().size() && contact_.points()[next].slave <= node; ++next) {
      if (contact_.points()[next].slave == node) foreseen = std::max(foreseen, -gaps_[next]);
    }
    if (!scene_.bodies[body].is_deformable()) continue;
    const Vector position = position_at_end(stage, node);
    for (const Tool& tool : scene_.tools) {
      const Real depth = -tool.distance_at_end(position);
      worst = std::max(worst, (depth - foreseen) / scene_.body_scales[body].edge);
      report_.max_penetration = std::max(report_.max_penetration, depth);
    }
  }
  report_.max_penetration = scene_.comm->max(report_.max_penetration);
  return scene_.comm->max(worst);
}

void ContactFlow::note_touching(const Stage& stage, const FreeSurface& surface) {
  touching_.clear();
  const auto components = static_cast<std::size_t>(scene_.dim() + 1);
  std::vector<Real> unknowns(static_cast<std::size_t>(contact_space_->nodes()) * components, 0.0);
  std::copy_n(state_.nodes.begin(), static_cast<std::size_t>(contact_space_->owned()) * components, unknowns.begin());
  contact_space_->halo().update_copies(unknowns, scene_.dim() + 1);
  const Real effective_step = stage.displacement.step * stage.displacement.now;
  for (const ContactPoint& point : contact_.points()) {
    const Vector slip = contact_.slip(point, *contact_space_, unknowns);
    const ContactTraction traction = ContactTerm::traction(point, slip);
    const Real gap = -effective_step * (point.normal.offset - point.normal.normal.dot(slip));
    const auto body = static_cast<std::size_t>(surface.body_of_node(point.slave));
    const bool presses = scene_.progress.was_pushed && traction.pressure > 0;
    if (!presses && gap > closed_gap * scene_.body_scales[body].edge) continue;
    const Vector shear = traction.traction - traction.pressure * point.normal.normal;
    const Real power = presses && point.rubs ? std::max(0.0, -shear.dot(slip)) : 0;
    touching_.push_back({point.surface, point.slave, point.opponent, point.area, power, point.masters, point.weights});
  }
}

void ContactFlow::measure_forces() {
  const std::size_t tools = scene_.tools.size();
  const std::size_t bodies = scene_.bodies.size();
  std::vector<Real> sums((tools + bodies) * 3 + 3, 0.0);
  for (std::size_t i = 0; i < contact_.points().size(); ++i) {
    const ContactPoint& point = contact_.points()[i];
    const auto opponent = static_cast<std::size_t>(point.opponent);
    const std::size_t at =
        opponent < tools ? opponent : tools + static_cast<std::size_t>(scene_.pairs[opponent - tools].master);
    for (std::size_t c = 0; c < 3; ++c) {
      sums[at * 3 + c] -= point.area * tractions_[i].traction[static_cast<Eigen::Index>(c)];
    }
  }
  std::vector<Real> reactions(static_cast<std::size_t>(scene_.mesh.owned_nodes()) *
                              static_cast<std::size_t>(scene_.dim()));
  if (scene_.progress.was_pushed) {
    reactions = operator_->reactions(state_);
    const auto dim = static_cast<std::size_t>(scene_.dim());
    for (LocalId node = 0; node < scene_.mesh.owned_nodes(); ++node) {
      std::array<Real, 3> left_over = {0, 0, 0};
      std::copy_n(reactions.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(node) * dim), dim,
                  left_over.begin());
      operator_->constraints().project(node, left_over.data());
      for (std::size_t c = 0; c < dim; ++c) sums[(tools + bodies) * 3 + c] += left_over[c];
    }
  }
  scene_.comm->sum_in_place(sums);
  measure_powers(reactions);
  const auto vector_at = [&](std::size_t i) { return to_vector(sums.data() + 3 * i, 3); };
  report_.tool_forces.clear();
  report_.body_forces.clear();
  report_.boundary_forces.clear();
  Real largest = 0;
  for (std::size_t t = 0; t < tools; ++t) report_.tool_forces.push_back(vector_at(t));
  for (std::size_t b = 0; b < bodies; ++b) report_.body_forces.push_back(vector_at(tools + b));
  for (std::size_t i = 0; i < scene_.boundaries->settings().size(); ++i) {
    const auto force = scene_.boundaries->force(i, reactions);
    report_.boundary_forces.push_back(to_vector(force.data(), 3));
    largest = std::max(largest, report_.boundary_forces.back().norm());
  }
  for (const Vector& force : report_.tool_forces) largest = std::max(largest, force.norm());
  report_.force_imbalance = largest > 0 ? vector_at(tools + bodies).norm() / largest : 0;
}

void ContactFlow::measure_powers(std::span<const Real> reactions) {
  const auto dim = static_cast<std::size_t>(scene_.dim());
  const std::size_t opponents = scene_.tools.size() + scene_.pairs.size();
  std::vector<Real> sums(opponents + 5, 0.0);  // areas; powers imposed, of tools, of contacts, of penalties twice
  for (std::size_t i = 0; i < contact_.points().size(); ++i) {
    const ContactPoint& point = contact_.points()[i];
    const ContactTraction& traction = tractions_[i];
    if (traction.pressure > 0) sums[static_cast<std::size_t>(point.opponent)] += point.area;
    sums[opponents + 1] += point.area * traction.traction.dot(point.opponent_velocity);
    sums[opponents + 2] -= point.area * traction.traction.dot(slips_[i]);
    sums[opponents + 3] += point.area * traction.pressure * point.normal.normal.dot(slips_[i]);
    const Real given = traction.pressure - point.normal.multiplier;
    if (traction.pressure > 0 && given > 0) sums[opponents + 4] += point.area * given * given / point.normal.penalty;
  }
  for (LocalId node = 0; node < scene_.mesh.owned_nodes() && scene_.progress.was_pushed; ++node) {
    sums[opponents] +=
        to_vector(reactions.data() + static_cast<std::size_t>(node) * dim, scene_.dim()).dot(velocity_of(node));
  }
  scene_.comm->sum_in_place(sums);
  report_.contact_areas.assign(sums.begin(), sums.begin() + static_cast<std::ptrdiff_t>(opponents));
  report_.power.imposed = sums[opponents];
  report_.power.tools = sums[opponents + 1];
  report_.power.contact = sums[opponents + 2];
  report_.penalty_power = sums[opponents + 3];
  report_.lost_power = sums[opponents + 4];
  report_.power.deformation = 0;
  if (!scene_.progress.was_pushed) return;
  operator_->update_viscosity(state_);
  report_.power.deformation = operator_->dissipation(state_);
}

void ContactFlow::store_fields() {
  const Mesh& mesh = scene_.mesh;
  const auto dim = static_cast<std::size_t>(scene_.dim());
  Field& velocity = scene_.fields[field_name::velocity];
  Field& pressure = scene_.fields[field_name::pressure];
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real* unknowns = state_.nodes.data() + static_cast<std::size_t>(node) * (dim + 1);
    std::copy_n(unknowns, dim, velocity.at(node));
    *pressure.at(node) = unknowns[dim];
  }
  auto viscosity = scene_.fields[field_name::viscosity].values();
  auto strain_rate = scene_.fields[field_name::strain_rate].values();
  if (scene_.progress.was_pushed) operator_->update_viscosity(state_);
  for (std::size_t e = 0; e < viscosity.size(); ++e) {
    viscosity[e] = scene_.progress.was_pushed ? operator_->viscosity()[e] : 0;
    strain_rate[e] = scene_.progress.was_pushed ? operator_->shear_rate()[e] / std::sqrt(3.0) : 0;
  }
  if (!scene_.fields.has(field_name::contact_pressure)) return;
  auto contact_pressure = scene_.fields[field_name::contact_pressure].values();
  auto contact_gap = scene_.fields[field_name::contact_gap].values();
  std::fill(contact_pressure.begin(), contact_pressure.end(), 0.0);
  std::fill(contact_gap.begin(), contact_gap.end(), scene_.scale.height);
  for (std::size_t i = 0; i < contact_.points().size(); ++i) {
    const auto node = static_cast<std::size_t>(contact_.points()[i].slave);
    contact_pressure[node] = std::max(contact_pressure[node], tractions_[i].pressure);
    contact_gap[node] = std::min(contact_gap[node], gaps_[i]);
  }
  mesh.node_halo.update_copies(contact_pressure, 1);
  mesh.node_halo.update_copies(contact_gap, 1);
}

void ContactFlow::measure_rates() {
  const Mesh& mesh = scene_.mesh;
  Real edge_rate = 0;
  Real strain_rate = 0;
  const auto rates = std::as_const(scene_.fields)[field_name::strain_rate].values();
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const Vector edge = to_vector(mesh.point(nodes[i]), mesh.dim) - to_vector(mesh.point(nodes[j]), mesh.dim);
        edge_rate = std::max(edge_rate, (velocity_of(nodes[i]) - velocity_of(nodes[j])).norm() / edge.norm());
      }
    }
    strain_rate = std::max(strain_rate, rates[static_cast<std::size_t>(e)]);
  }
  edge_rate_ = scene_.comm->max(edge_rate);
  strain_rate_ = scene_.comm->max(strain_rate);
}

void compute_stress(const Scene& scene, std::span<Real> stress) {
  const Mesh& mesh = scene.mesh;
  const Field& velocity = scene.fields[field_name::velocity];
  const Field& pressure = scene.fields[field_name::pressure];
  const auto viscosity = scene.fields[field_name::viscosity].values();
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    constexpr int components = D * (D + 1) / 2;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const P1Gradients<D> p1 = p1_gradients<D>(simplex_points<D>(mesh, e));
      Eigen::Matrix<Real, D, D> gradient = Eigen::Matrix<Real, D, D>::Zero();
      Real mean_pressure = 0;
      for (int i = 0; i <= D; ++i) {
        const LocalId node = mesh.nodes_of_element(e)[static_cast<std::size_t>(i)];
        gradient += Eigen::Map<const Point<D>>(velocity.at(node)) * p1.gradients.col(i).transpose();
        mean_pressure += *pressure.at(node) / (D + 1);
      }
      const Real eta = viscosity[static_cast<std::size_t>(e)];
      Eigen::Matrix<Real, D, D> sigma = eta * (gradient + gradient.transpose());
      sigma.diagonal().array() -= mean_pressure;
      Real* out = stress.data() + static_cast<std::size_t>(e) * components;
      for (int i = 0; i < D; ++i) out[i] = sigma(i, i);
      out[D] = sigma(0, 1);
      if constexpr (D == 3) {
        out[4] = sigma(1, 2);
        out[5] = sigma(0, 2);
      }
    }
  });
}

}  // namespace malleus::forge
