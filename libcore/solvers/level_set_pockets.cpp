#include "solvers/level_set_pockets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace malleus {
namespace {

/// [region] whether it is to be filled; the same on all ranks.
std::vector<char> unresolved_regions(const Communicator& comm, const Mesh& mesh, const NodeRegions& regions,
                                     std::span<const char> open) {
  const int most = unresolved_nodes(mesh.dim);
  std::vector<GlobalId> size(static_cast<std::size_t>(regions.count), 0);
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    const std::int32_t region = regions.of_node[static_cast<std::size_t>(node)];
    if (region >= 0) size[static_cast<std::size_t>(region)] += open[static_cast<std::size_t>(node)] != 0 ? most + 1 : 1;
  }
  comm.sum_in_place(std::span(size));
  std::vector<char> unresolved(size.size());
  std::transform(size.begin(), size.end(), unresolved.begin(),
                 [&](GlobalId s) { return static_cast<char>(s <= most); });
  return unresolved;
}

}  // namespace

NodeRegions regions_outside(const Communicator& comm, const Mesh& mesh, std::span<const Real> level_set) {
  std::array<LocalId, 4> nodes;
  return connected_regions(comm, mesh, [&](LocalId element) {
    std::size_t count = 0;
    for (const LocalId node : mesh.nodes_of_element(element)) {
      if (!(level_set[static_cast<std::size_t>(node)] > 0)) nodes[count++] = node;
    }
    return std::span<const LocalId>(nodes.data(), count);
  });
}

int fill_unresolved_pockets(const Communicator& comm, const Mesh& mesh, std::span<const char> open,
                            std::span<Real> level_set) {
  const NodeRegions regions = regions_outside(comm, mesh, level_set);
  if (regions.count == 0) return 0;
  const std::vector<char> unresolved = unresolved_regions(comm, mesh, regions, open);
  const auto pockets = static_cast<int>(std::count(unresolved.begin(), unresolved.end(), 1));
  if (pockets == 0) return 0;

  std::vector<Real> around(level_set.size(), 0);
  for (LocalId element = 0; element < mesh.elements(); ++element) {
    Real largest = 0;
    for (const LocalId node : mesh.nodes_of_element(element)) {
      largest = std::max(largest, level_set[static_cast<std::size_t>(node)]);
    }
    for (const LocalId node : mesh.nodes_of_element(element)) {
      around[static_cast<std::size_t>(node)] = std::max(around[static_cast<std::size_t>(node)], largest);
    }
  }
  mesh.node_halo.max_to_owners(around, 1);
  mesh.node_halo.update_copies(around, 1);
  for (std::size_t node = 0; node < level_set.size(); ++node) {
    const std::int32_t region = regions.of_node[node];
    if (region < 0 || unresolved[static_cast<std::size_t>(region)] == 0) continue;
    level_set[node] = std::max(std::abs(level_set[node]), around[node]);
  }
  return pockets;
}

}  // namespace malleus
