#include "mesh/node_regions.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "base/index.hpp"

namespace malleus {
namespace {

constexpr Real no_label = std::numeric_limits<Real>::max();

/// [node] the lowest global number of a node of its region (exact as Real below 2^53).
std::vector<Real> label_nodes(const Communicator& comm, const Mesh& mesh,
                              const std::function<std::span<const LocalId>(LocalId)>& joined) {
  std::vector<Real> label(index(mesh.nodes()), no_label);
  std::vector<LocalId> parent(index(mesh.nodes()));
  std::iota(parent.begin(), parent.end(), 0);
  const auto root_of = [&](LocalId node) {
    while (parent[index(node)] != node) node = parent[index(node)] = parent[index(parent[index(node)])];
    return node;
  };
  for (LocalId element = 0; element < mesh.elements(); ++element) {
    const std::span<const LocalId> nodes = joined(element);
    for (const LocalId node : nodes) {
      label[index(node)] = static_cast<Real>(mesh.global_node(node));
      parent[index(root_of(node))] = root_of(nodes[0]);
    }
  }
  // Within a rank in one sweep; from rank to rank until nothing changes.
  std::vector<Real> before;
  do {
    before = label;
    for (LocalId node = 0; node < mesh.nodes(); ++node) {
      Real& least = label[index(root_of(node))];
      least = std::min(least, label[index(node)]);
    }
    for (LocalId node = 0; node < mesh.nodes(); ++node) label[index(node)] = label[index(root_of(node))];
    mesh.node_halo.min_to_owners(std::span(label), 1);
    mesh.node_halo.update_copies(std::span(label), 1);
  } while (comm.any(before != label));
  return label;
}

}  // namespace

NodeRegions connected_regions(const Communicator& comm, const Mesh& mesh,
                              const std::function<std::span<const LocalId>(LocalId)>& joined, GlobalId most) {
  const std::vector<Real> label = label_nodes(comm, mesh, joined);
  std::vector<GlobalId> mine;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    if (label[index(node)] == static_cast<Real>(mesh.global_node(node))) mine.push_back(mesh.global_node(node));
  }
  const auto count = static_cast<GlobalId>(mine.size());
  const GlobalId total = comm.sum(count);
  NodeRegions regions;
  regions.of_node.assign(label.size(), -1);
  regions.is_complete = total <= most;
  if (total == 0 || !regions.is_complete) return regions;
  regions.count = static_cast<int>(total);
  // Owned nodes are numbered rank after rank, so the list is in increasing order.
  std::vector<GlobalId> labels(static_cast<std::size_t>(total), 0);
  std::copy(mine.begin(), mine.end(), labels.begin() + comm.sum_of_lower_ranks(count));
  comm.sum_in_place(std::span(labels));
  for (std::size_t node = 0; node < label.size(); ++node) {
    if (label[node] == no_label) continue;
    const auto place = std::lower_bound(labels.begin(), labels.end(), static_cast<GlobalId>(label[node]));
    regions.of_node[node] = static_cast<std::int32_t>(place - labels.begin());
  }
  return regions;
}

}  // namespace malleus
