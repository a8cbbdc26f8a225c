#include "inject/void_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fem/pressure_extension.hpp"
#include "solvers/level_set_extension.hpp"

namespace malleus::inject {
namespace {

/// Elements at the inlets, with the fluid that comes in there.
std::vector<std::pair<LocalId, int>> elements_at_gates(const Scene& scene) {
  std::vector<std::pair<LocalId, int>> found;
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const int fluid = scene.settings.fluid_index(scene.settings.inlets[part->index].fluid);
    for (LocalId e = 0; e < scene.mesh.elements(); ++e) {
      const auto nodes = scene.mesh.nodes_of_element(e);
      if (std::any_of(nodes.begin(), nodes.end(), [&](LocalId node) { return part->normals->holds(node); })) {
        found.emplace_back(e, fluid);
      }
    }
  }
  return found;
}

}  // namespace

VoidModel::VoidModel(Scene& scene, FrontSet& fronts, Mixture& mixture)
    : scene_(scene), fronts_(fronts), mixture_(mixture) {
  const auto& air = scene.settings.common.air;
  if (air && air->trapped == TrappedAir::gas) gas_.emplace(scene_, air->pressure);
  rebuild();
}

void VoidModel::rebuild() {
  mixture_.set_fed(elements_at_gates(scene_));
  if (gas_) gas_->forget_places();
}

void VoidModel::find(Real time) {
  voids_ = find_void_regions(scene_, fronts_, mixture_, time);
  const auto& air = scene_.settings.common.air;
  for (VoidRegion& region : voids_.regions) {
    region.is_vented = region.is_vented || (air && air->trapped == TrappedAir::vented);
  }
  if (gas_) gas_->update(voids_);
}

void VoidModel::add_to(FlowConditions& conditions, Real dt) {
  walls_ = conditions.constraints;
  pockets_.clear();
  const Real shrinks = dt > 0 ? shrinkage(dt) : 0;
  std::vector<Real>& pressure_of = conditions.loads.void_pressure;
  pressure_of.assign(static_cast<std::size_t>(scene_.mesh.elements()), 0.0);
  for (std::size_t k = 0; k < voids_.regions.size(); ++k) {
    const VoidRegion& region = voids_.regions[k];
    if (region.is_vented || (gas_ && dt == 0)) {
      const Real pressure = is_closed(k) ? gas_->pressure(k) : region.pressure;
      for (const LocalId e : region.elements) pressure_of[static_cast<std::size_t>(e)] = pressure;
      continue;
    }
    FluxGate pocket;
    pocket.voids = region.elements;
    if (gas_) {
      pocket.compliance = gas_->compliance(k, (1 - shrinks) * region.volume, dt);
      pocket.reference = gas_->pressure(k);
    }
    conditions.gates.push_back(pocket);
    pockets_.push_back(std::move(pocket));
  }
}

/// Share of its volume that the trapped gas will lose within dt at the flow of before.
Real VoidModel::shrinkage(Real dt) const {
  Real inflow = 0;
  Real volume = 0;
  for (const Real rate : inflows_) inflow += rate;
  for (std::size_t k = 0; k < voids_.regions.size(); ++k) volume += is_closed(k) ? voids_.regions[k].volume : 0;
  return volume > 0 ? std::clamp(inflow * dt / volume, 0.0, 0.5) : 0;
}

/// The pockets' pressures are the last borders.
void VoidModel::read_pressures(std::span<const Real> borders, Real inflow) {
  pressures_.clear();
  inflows_.clear();
  const std::size_t gates = borders.size() - pockets_.size();
  std::size_t pocket = 0;
  for (std::size_t k = 0; k < voids_.regions.size(); ++k) {
    if (!is_closed(k)) {
      pressures_.push_back(voids_.regions[k].pressure);
      inflows_.push_back(0);
    } else if (pockets_.empty()) {
      pressures_.push_back(gas_->pressure(k));
      inflows_.push_back(inflow);
    } else {
      const FluxGate& gate = pockets_[pocket];
      pressures_.push_back(borders[gates + pocket++]);
      inflows_.push_back(gate.compliance * (pressures_.back() - gate.reference));
    }
  }
}

void VoidModel::fill(std::span<const Real> element_viscosity, Real inflow, StokesState& unknowns) {
  read_pressures(unknowns.borders, inflow);
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  const std::span<Real> velocity = scene_.fields["velocity"].values();
  const std::span<Real> pressure = scene_.fields["pressure"].values();
  const std::vector<char> is_known = modelled_nodes(scene_.mesh, element_viscosity);
  const auto hold = [&](LocalId node, Real* v) { walls_.impose(node, v); };
  extend_velocity(scene_.comm, scene_.mesh, is_known, fronts_.united(), hold, velocity);
  for (std::size_t node = 0; node < pressure.size(); ++node) {
    if (is_known[node] != 0) continue;
    const std::int32_t region = voids_.of_node[node];
    if (region >= 0) pressure[node] = pressures_[static_cast<std::size_t>(region)];
    std::copy_n(velocity.data() + node * dim, dim, unknowns.nodes.data() + node * (dim + 1));
    unknowns.nodes[node * (dim + 1) + dim] = pressure[node];
  }
  if (gas_) gas_->publish(voids_, pressures_);
}

Real VoidModel::largest_step() const {
  constexpr Real largest_change = 0.1;
  Real step = std::numeric_limits<Real>::infinity();
  if (!gas_ || inflows_.size() != voids_.regions.size()) return step;  // not solved yet
  for (std::size_t k = 0; k < voids_.regions.size(); ++k) {
    if (!is_closed(k) || inflows_[k] == 0) continue;
    step = std::min(step, largest_change * voids_.regions[k].volume / std::abs(inflows_[k]));
  }
  return step;
}

std::array<Real, 2> VoidModel::trapped_gas() const {
  std::array<Real, 2> result = {0, 0};
  for (std::size_t k = 0; k < voids_.regions.size(); ++k) {
    if (!is_closed(k)) continue;
    result[0] += voids_.regions[k].volume;
    if (k < pressures_.size()) result[1] = std::max(result[1], pressures_[k]);
  }
  return result;
}

nlohmann::json VoidModel::save() const {
  nlohmann::json regions = nlohmann::json::array();
  for (const VoidRegion& region : voids_.regions) {
    regions.push_back({{"volume", region.volume}, {"is_vented", region.is_vented}, {"pressure", region.pressure}});
  }
  nlohmann::json saved = {{"regions", regions}, {"pressures", pressures_}, {"inflows", inflows_}};
  if (gas_) saved["gas"] = gas_->save();
  return saved;
}

void VoidModel::load(const nlohmann::json& saved) {
  voids_ = {};
  for (const nlohmann::json& region : saved.at("regions")) {
    VoidRegion& known = voids_.regions.emplace_back();
    known.volume = region.at("volume");
    known.is_vented = region.at("is_vented");
    known.pressure = region.at("pressure");
  }
  pressures_ = saved.at("pressures").get<std::vector<Real>>();
  inflows_ = saved.at("inflows").get<std::vector<Real>>();
  if (gas_) gas_->load(saved.at("gas"));
}

}  // namespace malleus::inject
