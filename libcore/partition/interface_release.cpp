#include "partition/interface_release.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>

#include "base/error.hpp"
#include "mesh/faces.hpp"
#include "parallel/gather.hpp"
#include "parallel/sparse_exchange.hpp"
#include "partition/node_parts.hpp"
#include "partition/pair_refiner.hpp"
#include "partition/partition_cost.hpp"

namespace malleus {
namespace {

/// Cut edges that a node of an old border is worth to the levelling: a new border rather goes this far around.
constexpr std::int32_t old_node_weight = 20;

/// A number that orders the parts differently in each round, none alike.
std::uint64_t drawn_number(int part, int round) {
  std::uint64_t x = static_cast<std::uint64_t>(part) + 0x9E3779B97F4A7C15ULL * static_cast<std::uint64_t>(round + 1);
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return (x ^ (x >> 31)) >> 24 << 24 | static_cast<std::uint64_t>(part);  // parts are fewer than 2^24
}

/// The parts around every local node between parts, copies included; nothing at other nodes.
struct AroundNodes {
  std::vector<std::int64_t> start;  ///< [node + 1]
  std::vector<int> parts;           ///< increasing for each node

  std::span<const int> of(LocalId node) const {
    const auto n = static_cast<std::size_t>(node);
    return {parts.data() + start[n], static_cast<std::size_t>(start[n + 1] - start[n])};
  }
};

/// Owners tell the holders of copies which parts are around their nodes. Collective.
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

/// Work of each part beyond its share. Collective.
std::vector<Real> excess_of_parts(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                  std::span<const int> parts) {
  std::vector<Real> excess = part_loads(comm, graph, parts, architecture.parts());
  const Real total = std::accumulate(excess.begin(), excess.end(), Real{0});
  for (std::size_t p = 0; p < excess.size(); ++p) {
    excess[p] -= total * architecture.speed[p] / architecture.total_speed();
  }
  return excess;
}

/// [node] 1 at the nodes between parts, alike on all holders.
std::vector<std::int32_t> mark_split_nodes(const Mesh& mesh, const SplitNodes& split) {
  std::vector<std::int32_t> marks(static_cast<std::size_t>(mesh.nodes()), 0);
  for (const LocalId node : split.nodes) marks[static_cast<std::size_t>(node)] = 1;
  mesh.node_halo.update_copies(std::span<std::int32_t>(marks), 1);
  return marks;
}

/// Work of the elements of one part that lie at nodes shared with another, shared out among all such others.
struct LayerWork {
  int part;
  int other;
  Real work;
};

/// The layers between the parts, by (part, other), the same on all ranks.
std::vector<LayerWork> weigh_layers(const Communicator& comm, const Mesh& mesh, const WorkGraph& graph,
                                    const AroundNodes& around, std::span<const int> parts) {
  std::map<std::pair<int, int>, Real> layers;
  std::vector<int> others;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const int part = parts[static_cast<std::size_t>(e)];
    others.clear();
    for (const LocalId node : mesh.nodes_of_element(e)) {
      for (const int other : around.of(node)) {
        if (other != part && std::find(others.begin(), others.end(), other) == others.end()) others.push_back(other);
      }
    }
    for (const int other : others) {
      layers[{part, other}] += graph.weights[static_cast<std::size_t>(e)] / static_cast<Real>(others.size());
    }
  }
  std::vector<LayerWork> mine;
  for (const auto& [pair, work] : layers) mine.push_back({pair.first, pair.second, work});
  layers.clear();
  for (const LayerWork& layer : gather_lists<LayerWork>(comm, mine)) layers[{layer.part, layer.other}] += layer.work;
  std::vector<LayerWork> all;
  for (const auto& [pair, work] : layers) all.push_back({pair.first, pair.second, work});
  return all;
}

/// For each pair of neighbouring parts the one that takes a layer from the other, such that what a part gives and takes
/// cancels: heaviest pairs first, then turned round while that helps.
class Directions {
 public:
  Directions(const std::vector<LayerWork>& layers, std::vector<Real> excess) : net_(std::move(excess)) {
    for (const LayerWork& layer : layers) {
      Pair& pair = pairs_[std::minmax(layer.part, layer.other)];
      (layer.part < layer.other ? pair.from_low : pair.from_high) += layer.work;
    }
    std::vector<std::pair<Real, std::pair<int, int>>> order;
    for (const auto& [parts, pair] : pairs_) order.push_back({pair.from_low + pair.from_high, parts});
    std::sort(order.rbegin(), order.rend());
    for (const auto& [weight, parts] : order) {
      Pair& pair = pairs_[parts];
      pair.is_taken_by_low = net(parts.first) < net(parts.second);
      transfer(parts, pair, 1);
    }
    constexpr int sweeps = 30;
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      for (const auto& [weight, parts] : order) turn_if_better(parts);
    }
  }

  bool takes(int part, int from) const {
    const auto found = pairs_.find(std::minmax(part, from));
    return found != pairs_.end() && found->second.is_taken_by_low == (part < from);
  }

 private:
  struct Pair {
    Real from_low = 0;   ///< work that the higher part takes if it wins
    Real from_high = 0;  ///< work that the lower part takes if it wins
    bool is_taken_by_low = false;
  };

  Real& net(int part) { return net_[static_cast<std::size_t>(part)]; }

  void transfer(std::pair<int, int> parts, const Pair& pair, Real sign) {
    const Real amount = sign * (pair.is_taken_by_low ? pair.from_high : -pair.from_low);
    net(parts.first) += amount;
    net(parts.second) -= amount;
  }

  void turn_if_better(std::pair<int, int> parts) {
    Pair& pair = pairs_[parts];
    const auto badness = [&] { return net(parts.first) * net(parts.first) + net(parts.second) * net(parts.second); };
    const Real before = badness();
    transfer(parts, pair, -1);
    pair.is_taken_by_low = !pair.is_taken_by_low;
    transfer(parts, pair, 1);
    if (badness() < before) return;
    transfer(parts, pair, -1);
    pair.is_taken_by_low = !pair.is_taken_by_low;
    transfer(parts, pair, 1);
  }

  std::map<std::pair<int, int>, Pair> pairs_;
  std::vector<Real> net_;  ///< work of each part beyond its share
};

/// Each element goes to the winner at most of its nodes between parts; at a node wins the part that takes from most of
/// the others there.
std::vector<int> shift_by_directions(const Mesh& mesh, const AroundNodes& around, const Directions& directions,
                                     std::span<const int> parts) {
  std::vector<int> winners(static_cast<std::size_t>(mesh.nodes()), -1);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    int most = -1;
    for (const int part : around.of(node)) {
      int wins = 0;
      for (const int other : around.of(node)) wins += other != part && directions.takes(part, other) ? 1 : 0;
      if (wins <= most) continue;
      most = wins;
      winners[static_cast<std::size_t>(node)] = part;
    }
  }
  std::vector<int> shifted(parts.begin(), parts.end());
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    std::array<int, 4> candidates = {-1, -1, -1, -1};
    std::size_t count = 0;
    for (const LocalId node : mesh.nodes_of_element(e)) {
      if (winners[static_cast<std::size_t>(node)] >= 0) candidates[count++] = winners[static_cast<std::size_t>(node)];
    }
    std::ptrdiff_t most = 0;
    std::sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count));
    for (std::size_t i = 0; i < count; ++i) {
      const auto same =
          std::count(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count), candidates[i]);
      if (same <= most) continue;
      most = same;
      shifted[static_cast<std::size_t>(e)] = candidates[i];
    }
  }
  return shifted;
}

/// The part that takes over around each node between parts, by drawn order: [node], -1 elsewhere.
std::vector<std::int32_t> draw_winners(const Mesh& mesh, const AroundNodes& around, int round) {
  std::vector<std::int32_t> winners(static_cast<std::size_t>(mesh.nodes()), -1);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const auto here = around.of(node);
    if (here.empty()) continue;
    winners[static_cast<std::size_t>(node)] = *std::max_element(
        here.begin(), here.end(), [&](int a, int b) { return drawn_number(a, round) < drawn_number(b, round); });
  }
  return winners;
}

/// Each element goes to the part drawn highest of those that win at its nodes.
std::vector<int> shift_by_a_layer(const Mesh& mesh, std::span<const std::int32_t> winners, std::span<const int> parts,
                                  int round) {
  std::vector<int> shifted(parts.begin(), parts.end());
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    int winner = -1;
    for (const LocalId node : mesh.nodes_of_element(e)) {
      const int here = winners[static_cast<std::size_t>(node)];
      if (here < 0) continue;
      if (winner < 0 || drawn_number(here, round) > drawn_number(winner, round)) winner = here;
    }
    if (winner >= 0) shifted[static_cast<std::size_t>(e)] = winner;
  }
  return shifted;
}

/// Makes faces at marked nodes dear to cut.
void weigh_old_borders(const Mesh& mesh, std::span<const std::int32_t> marks, WorkGraph& graph) {
  for (LocalId e = 0; e < graph.owned(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t j = graph.first(e); j < graph.last(e); ++j) {
      for (int k = 0; k < mesh.dim; ++k) {
        const int corner = face_node(mesh.dim, graph.faces[j], k);
        graph.edge_weights[j] +=
            old_node_weight * marks[static_cast<std::size_t>(nodes[static_cast<std::size_t>(corner)])];
      }
    }
  }
}

std::vector<int> level(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                       std::vector<int> parts, Real tolerance) {
  Real total = 0;
  for (const Real w : graph.weights) total += w;
  total = comm.sum(total);
  std::vector<Real> targets;
  for (const Real speed : architecture.speed) targets.push_back(total * speed / architecture.total_speed());
  parts.resize(static_cast<std::size_t>(graph.vertices()));
  graph.halo.update_copies(std::span<std::int32_t>(parts), 1);
  PairRefiner refiner(comm, graph, architecture, std::move(parts), std::move(targets));
  if (refiner.imbalance() > tolerance) {
    refiner.smooth(tolerance, {2, 4, 2, 300});  // along the old borders this gives back least
    refiner.diffuse(0.9 * tolerance, 10);
  }
  parts = std::move(refiner).take_parts();
  parts.resize(static_cast<std::size_t>(graph.owned()));
  return parts;
}

/// Counts what is new in release.parts against the parts before. Collective.
void count_release(const Communicator& comm, const Mesh& mesh, std::span<const std::int32_t> old_marks,
                   std::span<const int> before, Release& release) {
  const SplitNodes split = find_split_nodes(comm, mesh, release.parts);
  GlobalId still = 0;
  for (const LocalId node : split.nodes) still += old_marks[static_cast<std::size_t>(node)];
  release.still = comm.sum(still);
  const auto owned = old_marks.first(static_cast<std::size_t>(mesh.owned_nodes()));
  release.interface_nodes = comm.sum(std::accumulate(owned.begin(), owned.end(), GlobalId{0}));
  GlobalId moved = 0;
  for (std::size_t e = 0; e < before.size(); ++e) moved += before[e] != release.parts[e] ? 1 : 0;
  release.moved_elements = comm.sum(moved);
}

Real imbalance_of(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                  std::span<const int> parts) {
  const std::vector<Real> excess = excess_of_parts(comm, graph, architecture, parts);
  const Real total = comm.sum(std::accumulate(graph.weights.begin(), graph.weights.end(), Real{0}));
  Real worst = 0;
  for (std::size_t p = 0; p < excess.size(); ++p) {
    worst = std::max(worst, excess[p] * architecture.total_speed() / (total * architecture.speed[p]));
  }
  return worst;
}

}  // namespace

Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const Architecture& architecture, std::span<const int> parts,
                               const ReleaseOptions& options) {
  WorkGraph graph = build_work_graph(comm, mesh, work);
  const SplitNodes split = find_split_nodes(comm, mesh, parts);
  const std::vector<std::int32_t> marks = mark_split_nodes(mesh, split);
  const AroundNodes around = spread_split_nodes(comm, mesh, split);
  Release release;
  if (options.balanced) {
    const Directions directions(weigh_layers(comm, mesh, graph, around, parts),
                                excess_of_parts(comm, graph, architecture, parts));
    weigh_old_borders(mesh, marks, graph);
    release.parts =
        level(comm, graph, architecture, shift_by_directions(mesh, around, directions, parts), options.tolerance);
  } else {
    release.parts = shift_by_a_layer(mesh, draw_winners(mesh, around, options.round), parts, options.round);
  }
  count_release(comm, mesh, marks, parts, release);
  release.imbalance = imbalance_of(comm, graph, architecture, release.parts);
  return release;
}

Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const ReleaseOptions& options) {
  const std::vector<int> here(static_cast<std::size_t>(mesh.elements()), comm.rank());
  return move_interfaces_inside(comm, mesh, work, equal_architecture(comm.size()), here, options);
}

}  // namespace malleus
