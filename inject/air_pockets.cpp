#include "inject/air_pockets.hpp"

#include <algorithm>
#include <cmath>

#include "fem/level_set_volume.hpp"
#include "solvers/level_set_pockets.hpp"

namespace malleus::inject {
namespace {

constexpr std::size_t sums_each = 5;  ///< volume, moments, openings

/// [region][sums_each] over all ranks.
std::vector<Real> sums_of(const Scene& scene, const FrontSet& fronts, const std::vector<Real>& filled,
                          const NodeRegions& regions) {
  const Mesh& mesh = scene.mesh;
  const auto dim = static_cast<std::size_t>(mesh.dim);
  const std::vector<char> open = fronts.ways_out();
  std::vector<Real> sums(sums_each * static_cast<std::size_t>(regions.count), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    const auto region_of = [&](LocalId node) { return regions.of_node[static_cast<std::size_t>(node)]; };
    const auto first = std::find_if(nodes.begin(), nodes.end(), [&](LocalId node) { return region_of(node) >= 0; });
    if (first == nodes.end()) continue;
    const auto unfilled = std::count_if(first, nodes.end(), [&](LocalId node) { return region_of(node) >= 0; });
    Real* sum = sums.data() + sums_each * static_cast<std::size_t>(region_of(*first));
    const Real volume = (1 - positive_fraction(mesh, filled, e)) * scene.measures[static_cast<std::size_t>(e)];
    sum[0] += volume;
    for (const LocalId node : nodes) {
      if (region_of(node) < 0) continue;
      for (std::size_t c = 0; c < dim; ++c) sum[1 + c] += volume * mesh.point(node)[c] / static_cast<Real>(unfilled);
    }
    for (const LocalId node : nodes) sum[4] += open[static_cast<std::size_t>(node)];
  }
  scene.comm.sum_in_place(std::span(sums));
  return sums;
}

}  // namespace

std::vector<AirPocket> find_air_pockets(const Scene& scene, const FrontSet& fronts) {
  const std::vector<Real> filled = fronts.united();
  const NodeRegions regions = regions_outside(scene.comm, scene.mesh, filled);
  if (!regions.is_complete) {
    AirPocket all;
    all.volume = scene.cavity - positive_volume(scene.comm, scene.mesh, scene.measures, filled);
    all.is_vented = true;
    return {all};
  }
  const std::vector<Real> sums = sums_of(scene, fronts, filled, regions);
  std::vector<AirPocket> pockets(static_cast<std::size_t>(regions.count));
  for (std::size_t k = 0; k < pockets.size(); ++k) {
    const Real* sum = sums.data() + sums_each * k;
    pockets[k].volume = sum[0];
    pockets[k].is_vented = sum[4] > 0;
    for (std::size_t c = 0; c < 3 && sum[0] > 0; ++c) pockets[k].place[c] = sum[1 + c] / sum[0];
  }
  std::stable_sort(pockets.begin(), pockets.end(),
                   [](const AirPocket& a, const AirPocket& b) { return a.volume > b.volume; });
  return pockets;
}

}  // namespace malleus::inject
