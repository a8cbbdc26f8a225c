#include "partition/partition_cost.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "parallel/gather.hpp"
#include "parallel/sparse_exchange.hpp"
#include "partition/node_parts.hpp"
#include "partition/pieces.hpp"

namespace malleus {
namespace {

/// A mesh edge whose nodes belong to different parts, by global node numbers, low < high.
struct CutEdge {
  GlobalId low, high;
  std::int64_t low_part, high_part;
  auto operator<=>(const CutEdge&) const = default;
};

std::vector<CutEdge> find_cut_edges(const Mesh& mesh, std::span<const int> part_of_node) {
  std::vector<CutEdge> edges;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      for (std::size_t j = i + 1; j < nodes.size(); ++j) {
        const int a = part_of_node[static_cast<std::size_t>(nodes[i])];
        const int b = part_of_node[static_cast<std::size_t>(nodes[j])];
        if (a == b) continue;
        const GlobalId low = mesh.global_node(nodes[i]);
        const GlobalId high = mesh.global_node(nodes[j]);
        edges.push_back(low < high ? CutEdge{low, high, a, b} : CutEdge{high, low, b, a});
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

/// Each cut edge on one rank.
std::vector<CutEdge> unique_cut_edges(const Communicator& comm, const Mesh& mesh, std::span<const int> part_of_node) {
  std::vector<CutEdge> edges = find_cut_edges(mesh, part_of_node);
  if (comm.size() == 1) return edges;
  std::map<int, std::vector<CutEdge>> outgoing;
  for (const CutEdge& edge : edges) outgoing[mesh.node_ownership.owner_of(edge.low)].push_back(edge);
  edges.clear();
  for (const auto& [rank, list] : sparse_exchange(comm, outgoing)) edges.insert(edges.end(), list.begin(), list.end());
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

class CostCounter {
 public:
  CostCounter(const Communicator& comm, const WorkModel& model, const Architecture& architecture)
      : comm_(comm),
        model_(model),
        architecture_(architecture),
        time_(static_cast<std::size_t>(architecture.parts()), 0) {}

  /// Sums over the ranks the communication time of each part. Collective.
  std::vector<Real> communication(const WorkGraph& graph, std::span<const int> parts,
                                  std::span<const CutEdge> cut_edges, std::span<const CutCoupling> couplings,
                                  PartitionCost& cost) {
    GlobalId cut = 0;
    for (LocalId v = 0; v < graph.owned(); ++v) {
      const int part = parts[static_cast<std::size_t>(v)];
      for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
        const int other = parts[static_cast<std::size_t>(graph.neighbours[j])];
        if (other == part || graph.faces[j] < 0) continue;
        cut += graph.edge_weights[j];
        add(part, other, graph.edge_weights[j]);
      }
    }
    for (const CutEdge& edge : cut_edges) {
      add(static_cast<int>(edge.low_part), static_cast<int>(edge.high_part), 1);
      add(static_cast<int>(edge.high_part), static_cast<int>(edge.low_part), 1);
    }
    for (const CutCoupling& coupling : couplings) {
      add(coupling.part, coupling.other, coupling.weight);
      add(coupling.other, coupling.part, coupling.weight);
    }
    cost.cut = comm_.sum(cut) / 2;
    cost.cut_couplings = comm_.sum(static_cast<GlobalId>(couplings.size()));
    cost.cut_edges = comm_.sum(static_cast<GlobalId>(cut_edges.size()));
    comm_.sum_in_place(std::span<Real>(time_));
    return time_;
  }

 private:
  void add(int part, int other, Real amount) {
    time_[static_cast<std::size_t>(part)] += model_.communication * amount * architecture_.inverse_link(part, other);
  }

  const Communicator& comm_;
  const WorkModel& model_;
  const Architecture& architecture_;
  std::vector<Real> time_;
};

void count_interfaces(const Communicator& comm, const SplitNodes& split, int n_parts, PartitionCost& cost) {
  std::vector<GlobalId> volume(static_cast<std::size_t>(n_parts), 0);
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t i = 0; i < split.nodes.size(); ++i) {
    const auto around = split.of(i);
    cost.communication_volume += static_cast<GlobalId>(around.size()) - 1;
    for (const int p : around) {
      volume[static_cast<std::size_t>(p)] += static_cast<GlobalId>(around.size()) - 1;
      for (const int q : around) {
        if (p < q) pairs.emplace_back(p, q);
      }
    }
  }
  comm.sum_in_place(std::span<GlobalId>(volume));
  cost.communication_volume = comm.sum(cost.communication_volume);
  cost.largest_volume = *std::max_element(volume.begin(), volume.end());
  cost.interface_nodes = comm.sum(static_cast<GlobalId>(split.nodes.size()));
  const auto make_unique = [&] {
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  };
  make_unique();
  std::vector<int> flat;
  for (const auto& [p, q] : pairs) flat.insert(flat.end(), {p, q});
  flat = gather_lists<int>(comm, flat);
  pairs.clear();
  for (std::size_t i = 0; i < flat.size(); i += 2) pairs.emplace_back(flat[i], flat[i + 1]);
  make_unique();
  std::vector<int> neighbours(static_cast<std::size_t>(n_parts), 0);
  for (const auto& [p, q] : pairs) {
    ++neighbours[static_cast<std::size_t>(p)];
    ++neighbours[static_cast<std::size_t>(q)];
  }
  cost.max_neighbours = *std::max_element(neighbours.begin(), neighbours.end());
  cost.mean_neighbours = 2.0 * static_cast<Real>(pairs.size()) / n_parts;
}

/// Elements, or owned nodes, of each part. Collective.
std::vector<Real> count_per_part(const Communicator& comm, std::span<const int> parts, int n_parts) {
  std::vector<Real> counts(static_cast<std::size_t>(n_parts), 0);
  for (const int part : parts) counts[static_cast<std::size_t>(part)] += 1;
  comm.sum_in_place(std::span<Real>(counts));
  return counts;
}

/// Largest amount / speed over the mean, minus 1.
Real imbalance_of(std::span<const Real> amounts, const Architecture& architecture) {
  const Real total = std::accumulate(amounts.begin(), amounts.end(), Real{0});
  if (total <= 0) return 0;
  Real largest = 0;
  for (std::size_t p = 0; p < amounts.size(); ++p) largest = std::max(largest, amounts[p] / architecture.speed[p]);
  return largest * architecture.total_speed() / total - 1;
}

}  // namespace

std::vector<Real> part_loads(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts,
                             int n_parts) {
  std::vector<Real> loads(static_cast<std::size_t>(n_parts), 0);
  for (LocalId v = 0; v < graph.owned(); ++v) {
    loads[static_cast<std::size_t>(parts[static_cast<std::size_t>(v)])] += graph.weights[static_cast<std::size_t>(v)];
  }
  comm.sum_in_place(std::span<Real>(loads));
  return loads;
}

PartitionCost partition_cost(const Communicator& comm, const Mesh& mesh, const WorkGraph& graph, const WorkModel& model,
                             const Architecture& architecture, std::span<const int> parts) {
  const int n_parts = architecture.parts();
  std::vector<int> all_parts(parts.begin(), parts.end());
  all_parts.resize(static_cast<std::size_t>(graph.vertices()));
  graph.halo.update_copies(std::span<std::int32_t>(all_parts), 1);
  const std::span<const int> own_parts(all_parts.data(), static_cast<std::size_t>(graph.owned()));

  PartitionCost cost;
  const SplitNodes split = find_split_nodes(comm, mesh, own_parts);
  count_interfaces(comm, split, n_parts, cost);
  const std::vector<int> part_of_node = assign_nodes(comm, mesh, split, model, architecture, own_parts);
  CostCounter counter(comm, model, architecture);
  const std::vector<Real> communication =
      counter.communication(graph, all_parts, unique_cut_edges(comm, mesh, part_of_node),
                            cut_couplings(comm, mesh, model.couplings, part_of_node), cost);

  const std::vector<Real> elements = count_per_part(comm, own_parts, n_parts);
  const std::vector<Real> nodes =
      count_per_part(comm, std::span(part_of_node).first(static_cast<std::size_t>(mesh.owned_nodes())), n_parts);
  const std::vector<Real> loads = part_loads(comm, graph, own_parts, n_parts);
  cost.imbalance = imbalance_of(loads, architecture);
  cost.node_imbalance = imbalance_of(nodes, architecture);
  cost.empty_parts = static_cast<int>(std::count(elements.begin(), elements.end(), 0));
  cost.stray_pieces = count_stray_pieces(comm, graph, all_parts, n_parts);

  const bool has_factors = comm.any(!model.factor.empty());
  std::vector<Real> work(loads);
  Real total = 0;
  for (std::size_t p = 0; p < work.size(); ++p) {
    work[p] = has_factors ? loads[p] * graph.unit : model.element * elements[p] + model.node * nodes[p];
    total += work[p];
  }
  cost.ideal_time = total / architecture.total_speed();
  cost.times.resize(work.size());
  for (std::size_t p = 0; p < work.size(); ++p) {
    cost.times[p] = (work[p] / architecture.speed[p] + communication[p]) / cost.ideal_time;
  }
  cost.cost = *std::max_element(cost.times.begin(), cost.times.end());
  return cost;
}

}  // namespace malleus
