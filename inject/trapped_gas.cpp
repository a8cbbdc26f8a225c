#include "inject/trapped_gas.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace malleus::inject {
namespace {

constexpr std::size_t most_pairs = 1'000'000;  ///< of old and new regions that are compared

}  // namespace

TrappedGas::TrappedGas(Scene& scene, Real absolute) : scene_(scene), absolute_(absolute) {
  scene_.fields.declare(scene_.mesh, {"air_pocket", "1", Support::node, 1, Transfer::interpolate, false});
  scene_.fields.declare(scene_.mesh, {"air_pressure", "Pa", Support::node, 1, Transfer::interpolate, false});
}

void TrappedGas::update(const VoidRegions& voids) {
  const std::vector<Real> contents = knows_places_ ? contents_by_places(voids) : contents_by_pressure(voids);
  contents_.clear();
  volumes_.clear();
  vented_.clear();
  for (std::size_t k = 0; k < voids.regions.size(); ++k) {
    const VoidRegion& region = voids.regions[k];
    const Real outside = (absolute_ + region.pressure) * region.volume;
    contents_.push_back(region.is_vented || !(contents[k] > 0) ? outside : contents[k]);
    volumes_.push_back(region.volume);
    vented_.push_back(region.is_vented);
  }
  const std::span<Real> pocket = scene_.fields["air_pocket"].values();
  for (std::size_t node = 0; node < pocket.size(); ++node) pocket[node] = voids.of_node[node];
  knows_places_ = true;
}

/// By how many nodes, weighted by the mesh around them, the regions were and are the same.
std::vector<Real> TrappedGas::contents_by_places(const VoidRegions& voids) const {
  const std::size_t before = contents_.size();
  const std::size_t now = voids.regions.size();
  std::vector<Real> contents(now, 0.0);
  if (before == 0 || now == 0 || before * now > most_pairs) return contents;
  const std::span<const Real> pocket = scene_.fields["air_pocket"].values();
  std::vector<Real> common(before * now, 0.0);
  for (LocalId n = 0; n < scene_.mesh.owned_nodes(); ++n) {
    const auto node = static_cast<std::size_t>(n);
    if (voids.of_node[node] < 0 || pocket[node] < 0) continue;
    const Real size = scene_.node_sizes[node];
    common[static_cast<std::size_t>(pocket[node]) * now + static_cast<std::size_t>(voids.of_node[node])] +=
        scene_.mesh.dim == 2 ? size * size : size * size * size;
  }
  scene_.comm.sum_in_place(std::span(common));
  std::vector<Real> known(now, 0.0);
  for (std::size_t j = 0; j < before; ++j) {
    for (std::size_t k = 0; k < now; ++k) known[k] += common[j * now + k];
  }
  for (std::size_t j = 0; j < before; ++j) {
    Real whole = 0;
    for (std::size_t k = 0; k < now; ++k) whole += common[j * now + k];
    for (std::size_t k = 0; k < now && whole > 0; ++k) {
      const Real part = common[j * now + k];
      if (part == 0) continue;
      // Air that could leave keeps its pressure, not its amount.
      contents[k] += vented_[j] != 0 ? contents_[j] / volumes_[j] * voids.regions[k].volume * part / known[k]
                                     : contents_[j] * part / whole;
    }
  }
  return contents;
}

std::vector<Real> TrappedGas::contents_by_pressure(const VoidRegions& voids) const {
  const std::span<const Real> pressure = scene_.fields["air_pressure"].values();
  std::vector<Real> largest(voids.regions.size(), -absolute_);
  for (std::size_t node = 0; node < pressure.size(); ++node) {
    if (voids.of_node[node] < 0) continue;
    Real& value = largest[static_cast<std::size_t>(voids.of_node[node])];
    value = std::max(value, pressure[node]);
  }
  scene_.comm.max_in_place(std::span(largest));
  for (std::size_t k = 0; k < largest.size(); ++k) largest[k] = (absolute_ + largest[k]) * voids.regions[k].volume;
  return largest;
}

void TrappedGas::publish(const VoidRegions& voids, const std::vector<Real>& inside) {
  const std::span<Real> pressure = scene_.fields["air_pressure"].values();
  for (std::size_t node = 0; node < pressure.size(); ++node) {
    const std::int32_t region = voids.of_node[node];
    pressure[node] = region < 0 ? 0 : inside[static_cast<std::size_t>(region)];
  }
}

nlohmann::json TrappedGas::save() const {
  return {{"contents", contents_}, {"volumes", volumes_}, {"vented", vented_}};
}

void TrappedGas::load(const nlohmann::json& saved) {
  contents_ = saved.at("contents").get<std::vector<Real>>();
  volumes_ = saved.at("volumes").get<std::vector<Real>>();
  vented_ = saved.at("vented").get<std::vector<char>>();
  // Interpolated on another mesh, numbers of regions mean nothing.
  const std::span<const Real> pocket = std::as_const(scene_.fields)["air_pocket"].values();
  knows_places_ = scene_.comm.all(
      std::all_of(pocket.begin(), pocket.end(), [](Real number) { return number == std::round(number); }));
}

}  // namespace malleus::inject
