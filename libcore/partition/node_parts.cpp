#include "partition/node_parts.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

constexpr int sweeps = 8;

struct NodePart {
  GlobalId node;
  std::int64_t part;
  auto operator<=>(const NodePart&) const = default;
};

/// The part of each local node where all its elements here have the same one, else -1.
std::vector<int> single_parts(const Mesh& mesh, std::span<const int> parts) {
  constexpr int unseen = -2;
  std::vector<int> part_of_node(static_cast<std::size_t>(mesh.nodes()), unseen);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const int part = parts[static_cast<std::size_t>(e)];
    for (const LocalId node : mesh.nodes_of_element(e)) {
      int& of_node = part_of_node[static_cast<std::size_t>(node)];
      of_node = of_node == unseen || of_node == part ? part : -1;
    }
  }
  return part_of_node;
}

/// (node, part) pairs of the nodes that are split here or may be split by the elements of other ranks; sent to the
/// nodes' owners and made unique there.
std::vector<NodePart> collect_pairs(const Communicator& comm, const Mesh& mesh, std::span<const int> parts,
                                    std::span<const int> single) {
  std::vector<char> is_open(static_cast<std::size_t>(mesh.nodes()), 0);
  for (const Halo::Partner& partner : mesh.node_halo.partners()) {
    for (const LocalId node : partner.sends) is_open[static_cast<std::size_t>(node)] = 1;
    for (const LocalId node : partner.receives) is_open[static_cast<std::size_t>(node)] = 1;
  }
  for (std::size_t n = 0; n < single.size(); ++n) is_open[n] |= single[n] == -1 ? 1 : 0;
  std::vector<NodePart> pairs;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e)) {
      if (is_open[static_cast<std::size_t>(node)] == 0) continue;
      pairs.push_back({mesh.global_node(node), parts[static_cast<std::size_t>(e)]});
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  if (comm.size() == 1) return pairs;
  std::map<int, std::vector<NodePart>> outgoing;
  for (const NodePart& pair : pairs) outgoing[mesh.node_ownership.owner_of(pair.node)].push_back(pair);
  pairs.clear();
  for (const auto& [rank, list] : sparse_exchange(comm, outgoing)) pairs.insert(pairs.end(), list.begin(), list.end());
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

/// Loads of the parts as one rank sees them while all assign their nodes at once.
class NodeLoads {
 public:
  NodeLoads(const Communicator& comm, const SplitNodes& split, const WorkModel& model, const Architecture& architecture,
            std::span<const int> parts)
      : comm_(comm), architecture_(architecture), node_(model.node) {
    const auto n = static_cast<std::size_t>(architecture.parts());
    base_.assign(n, 0);
    for (const int part : parts) base_[static_cast<std::size_t>(part)] += model.element;
    for (const int part : split.part_of_node) {
      if (part >= 0) base_[static_cast<std::size_t>(part)] += model.node;
    }
    competitors_.assign(n, 0);
    for (const int part : split.parts) competitors_[static_cast<std::size_t>(part)] = 1;
    comm.sum_in_place(std::span<Real>(base_));
    comm.sum_in_place(std::span<Real>(competitors_));
    loads_ = base_;
  }

  /// Takes up the loads with all split nodes where `owners` says. Collective.
  void refresh(std::span<const int> owners) {
    std::vector<Real> taken(base_.size(), 0);
    for (const int part : owners) taken[static_cast<std::size_t>(part)] += node_;
    comm_.sum_in_place(std::span<Real>(taken));
    for (std::size_t p = 0; p < base_.size(); ++p) loads_[p] = base_[p] + taken[p];
  }

  Real time(int part, Real nodes = 0) const {
    const auto p = static_cast<std::size_t>(part);
    return (loads_[p] + nodes * node_) / architecture_.speed[p];
  }
  void add(int part, Real nodes) {
    const auto p = static_cast<std::size_t>(part);
    loads_[p] += nodes * node_ * std::max(1.0, competitors_[p]);
  }

 private:
  const Communicator& comm_;
  const Architecture& architecture_;
  Real node_;
  std::vector<Real> base_;
  std::vector<Real> loads_;
  std::vector<Real> competitors_;  ///< ranks that have nodes to give to the part
};

int least_loaded(const NodeLoads& loads, std::span<const int> candidates) {
  int best = candidates.front();
  for (const int part : candidates) {
    if (loads.time(part) < loads.time(best)) best = part;
  }
  return best;
}

}  // namespace

SplitNodes find_split_nodes(const Communicator& comm, const Mesh& mesh, std::span<const int> parts) {
  check(parts.size() == static_cast<std::size_t>(mesh.elements()), "each element has a part");
  SplitNodes split;
  split.part_of_node = single_parts(mesh, parts);
  const std::vector<NodePart> pairs = collect_pairs(comm, mesh, parts, split.part_of_node);
  split.part_of_node.resize(static_cast<std::size_t>(mesh.owned_nodes()));
  split.start.assign(1, 0);
  for (std::size_t first = 0; first < pairs.size();) {
    std::size_t last = first;
    while (last < pairs.size() && pairs[last].node == pairs[first].node) ++last;
    const auto node = static_cast<LocalId>(pairs[first].node - mesh.node_ownership.begin());
    if (last - first == 1) {
      split.part_of_node[static_cast<std::size_t>(node)] = static_cast<int>(pairs[first].part);
    } else {
      split.part_of_node[static_cast<std::size_t>(node)] = -1;
      split.nodes.push_back(node);
      for (std::size_t i = first; i < last; ++i) split.parts.push_back(static_cast<int>(pairs[i].part));
      split.start.push_back(static_cast<std::int64_t>(split.parts.size()));
    }
    first = last;
  }
  return split;
}

std::vector<int> assign_nodes(const Communicator& comm, const Mesh& mesh, const SplitNodes& split,
                              const WorkModel& model, const Architecture& architecture, std::span<const int> parts) {
  NodeLoads loads(comm, split, model, architecture, parts);
  std::vector<int> owners(split.nodes.size());
  for (std::size_t i = 0; i < owners.size(); ++i) {
    owners[i] = least_loaded(loads, split.of(i));
    loads.add(owners[i], 1);
  }
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    loads.refresh(owners);
    for (std::size_t i = 0; i < owners.size(); ++i) {
      const int other = least_loaded(loads, split.of(i));
      if (loads.time(other, 1) >= loads.time(owners[i])) continue;
      loads.add(owners[i], -1);
      loads.add(other, 1);
      owners[i] = other;
    }
  }
  std::vector<int> part_of_node(split.part_of_node.begin(), split.part_of_node.end());
  for (std::size_t i = 0; i < owners.size(); ++i) part_of_node[static_cast<std::size_t>(split.nodes[i])] = owners[i];
  part_of_node.resize(static_cast<std::size_t>(mesh.nodes()), -1);
  mesh.node_halo.update_copies(std::span<std::int32_t>(part_of_node), 1);
  return part_of_node;
}

AroundNodes spread_split_nodes(const Communicator& comm, const Mesh& mesh, const SplitNodes& split) {
  std::vector<std::vector<int>> lists(static_cast<std::size_t>(mesh.nodes()));
  for (std::size_t i = 0; i < split.nodes.size(); ++i) {
    lists[static_cast<std::size_t>(split.nodes[i])].assign(split.of(i).begin(), split.of(i).end());
  }
  std::map<int, std::vector<int>> outgoing;  // for each shared node in turn the count and the parts
  for (const Halo::Partner& partner : mesh.node_halo.partners()) {
    if (partner.sends.empty()) continue;
    std::vector<int>& message = outgoing[partner.rank];
    for (const LocalId node : partner.sends) {
      const std::vector<int>& list = lists[static_cast<std::size_t>(node)];
      message.push_back(static_cast<int>(list.size()));
      message.insert(message.end(), list.begin(), list.end());
    }
  }
  const std::map<int, std::vector<int>> incoming = sparse_exchange(comm, outgoing);
  for (const Halo::Partner& partner : mesh.node_halo.partners()) {
    if (partner.receives.empty()) continue;
    const int* next = incoming.at(partner.rank).data();
    for (const LocalId node : partner.receives) {
      const int count = *next++;
      lists[static_cast<std::size_t>(node)].assign(next, next + count);
      next += count;
    }
  }
  AroundNodes around;
  around.start.assign(1, 0);
  for (const std::vector<int>& list : lists) {
    around.parts.insert(around.parts.end(), list.begin(), list.end());
    around.start.push_back(static_cast<std::int64_t>(around.parts.size()));
  }
  return around;
}

}  // namespace malleus
