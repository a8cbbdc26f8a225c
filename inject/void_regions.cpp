#include "inject/void_regions.hpp"

#include <algorithm>

namespace malleus::inject {
namespace {

/// Pressure [Pa] outside each node of an open vent or boundary, and whether it is one: [node][2], of this rank.
std::vector<Real> openings(const Scene& scene, const FrontSet& fronts, Real time) {
  const Mesh& mesh = scene.mesh;
  const std::vector<char> sealed = fronts.sealed_vent_nodes();
  std::vector<Real> result(static_cast<std::size_t>(mesh.nodes()) * 2, 0.0);
  for (const BoundaryPart& part : scene.parts) {
    if (!scene.is_opening(part)) continue;
    const Expression* pressure = nullptr;
    if (part.kind == BoundaryPart::Kind::vent) pressure = &scene.settings.vents[part.index].pressure;
    if (part.kind == BoundaryPart::Kind::imposed) {
      const auto& given = scene.settings.common.boundaries[part.index].pressure;
      pressure = given ? &*given : nullptr;
    }
    for (LocalId node = 0; node < mesh.nodes(); ++node) {
      if (!part.normals->holds(node) || sealed[static_cast<std::size_t>(node)] != 0) continue;
      std::array<Real, 3> place = {0, 0, 0};
      std::copy_n(mesh.point(node), mesh.dim, place.begin());
      result[static_cast<std::size_t>(node) * 2] = pressure != nullptr ? (*pressure)(place, time) : 0;
      result[static_cast<std::size_t>(node) * 2 + 1] = 1;
    }
  }
  return result;
}

/// What is summed over the elements and nodes of a region.
constexpr std::size_t sums_each = 6;  ///< volume, moments, openings' pressure and number

}  // namespace

VoidRegions find_void_regions(const Scene& scene, const FrontSet& fronts, const Mixture& mixture, Real time) {
  const Mesh& mesh = scene.mesh;
  const std::span<const Real> shares = mixture.shares(mixture.background());
  const std::span<const LocalId> nothing;
  const NodeRegions found = connected_regions(scene.comm, mesh, [&](LocalId e) {
    return shares[static_cast<std::size_t>(e)] >= 1 ? std::span<const LocalId>(mesh.nodes_of_element(e)) : nothing;
  });
  VoidRegions result;
  result.of_node = found.of_node;
  if (!found.is_complete) result.of_node.assign(static_cast<std::size_t>(mesh.nodes()), -1);
  const auto count = static_cast<std::size_t>(found.is_complete ? found.count : 0);
  result.regions.resize(count);
  std::vector<Real> sums(count * sums_each, 0.0);
  for (LocalId e = 0; e < mesh.elements() && count > 0; ++e) {
    const Real share = shares[static_cast<std::size_t>(e)];
    const auto nodes = mesh.nodes_of_element(e);
    const auto of = [&](LocalId node) { return result.of_node[static_cast<std::size_t>(node)]; };
    const auto first = std::find_if(nodes.begin(), nodes.end(), [&](LocalId node) { return of(node) >= 0; });
    if (first == nodes.end() || share <= 0) continue;
    const auto region = static_cast<std::size_t>(of(*first));
    if (share >= 1) result.regions[region].elements.push_back(e);
    const Real volume = share * scene.measures[static_cast<std::size_t>(e)];
    Real* sum = sums.data() + region * sums_each;
    sum[0] += volume;
    for (const LocalId node : nodes) {
      for (int c = 0; c < mesh.dim; ++c) sum[1 + c] += volume * mesh.point(node)[c] / static_cast<Real>(nodes.size());
    }
  }
  const std::vector<Real> open = openings(scene, fronts, time);
  for (LocalId node = 0; node < mesh.owned_nodes() && count > 0; ++node) {
    const std::int32_t region = result.of_node[static_cast<std::size_t>(node)];
    if (region < 0) continue;
    for (std::size_t k = 0; k < 2; ++k) {
      sums[static_cast<std::size_t>(region) * sums_each + 4 + k] += open[static_cast<std::size_t>(node) * 2 + k];
    }
  }
  scene.comm.sum_in_place(std::span(sums));
  for (std::size_t k = 0; k < count; ++k) {
    const Real* sum = sums.data() + k * sums_each;
    VoidRegion& region = result.regions[k];
    region.volume = sum[0];
    for (std::size_t c = 0; c < 3 && sum[0] > 0; ++c) region.place[c] = sum[1 + c] / sum[0];
    region.is_vented = sum[5] > 0;
    region.pressure = region.is_vented ? sum[4] / sum[5] : 0;
  }
  return result;
}

}  // namespace malleus::inject
