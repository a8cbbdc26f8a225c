#include "inject/air_pockets.hpp"

#include <algorithm>
#include <cmath>

#include "fem/level_set_volume.hpp"
#include "mesh/node_regions.hpp"

namespace malleus::inject {
namespace {

/// [node] positive where some front has passed.
std::vector<Real> union_of(const FrontSet& fronts) {
  const std::span<const Real> first = fronts.values(0);
  std::vector<Real> filled(first.begin(), first.end());
  for (std::size_t i = 1; i < fronts.size(); ++i) {
    const std::span<const Real> values = fronts.values(i);
    for (std::size_t n = 0; n < filled.size(); ++n) filled[n] = std::max(filled[n], values[n]);
  }
  return filled;
}

/// The nodes of each element that are not filled.
class UnfilledNodes {
 public:
  UnfilledNodes(const Mesh& mesh, const std::vector<Real>& filled) : mesh_(mesh), filled_(filled) {}

  std::span<const LocalId> of(LocalId element) {
    nodes_.clear();
    for (const LocalId node : mesh_.nodes_of_element(element)) {
      if (!(filled_[static_cast<std::size_t>(node)] > 0)) nodes_.push_back(node);
    }
    return nodes_;
  }

 private:
  const Mesh& mesh_;
  const std::vector<Real>& filled_;
  std::vector<LocalId> nodes_;
};

constexpr std::size_t sums_each = 5;  ///< volume, moments, openings

/// [region][sums_each] over all ranks.
std::vector<Real> sums_of(const Scene& scene, const FrontSet& fronts, const std::vector<Real>& filled,
                          const NodeRegions& regions, UnfilledNodes& unfilled) {
  const Mesh& mesh = scene.mesh;
  const auto dim = static_cast<std::size_t>(mesh.dim);
  const std::vector<char> open = fronts.ways_out();
  std::vector<Real> sums(sums_each * static_cast<std::size_t>(regions.count), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const std::span<const LocalId> nodes = unfilled.of(e);
    if (nodes.empty()) continue;
    Real* sum = sums.data() + sums_each * static_cast<std::size_t>(regions.of_node[static_cast<std::size_t>(nodes[0])]);
    const Real volume = (1 - positive_fraction(mesh, filled, e)) * scene.measures[static_cast<std::size_t>(e)];
    sum[0] += volume;
    for (const LocalId node : nodes) {
      const auto count = static_cast<Real>(nodes.size());
      for (std::size_t c = 0; c < dim; ++c) sum[1 + c] += volume * mesh.point(node)[c] / count;
    }
    for (const LocalId node : mesh.nodes_of_element(e)) sum[4] += open[static_cast<std::size_t>(node)];
  }
  scene.comm.sum_in_place(std::span(sums));
  return sums;
}

}  // namespace

std::vector<AirPocket> find_air_pockets(const Scene& scene, const FrontSet& fronts) {
  const std::vector<Real> filled = union_of(fronts);
  UnfilledNodes unfilled(scene.mesh, filled);
  const NodeRegions regions =
      connected_regions(scene.comm, scene.mesh, [&](LocalId element) { return unfilled.of(element); });
  if (!regions.is_complete) {
    AirPocket all;
    all.volume = scene.cavity - positive_volume(scene.comm, scene.mesh, scene.measures, filled);
    all.is_vented = true;
    return {all};
  }
  const std::vector<Real> sums = sums_of(scene, fronts, filled, regions, unfilled);
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
