#include "partition/interface_release.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "base/index.hpp"
#include "mesh/faces.hpp"
#include "partition/border_shares.hpp"
#include "partition/node_parts.hpp"
#include "partition/pair_refiner.hpp"

namespace malleus {
namespace {

/// Cut edges that a node of an old border is worth to the levelling: a new border rather goes this far around.
constexpr std::int32_t old_node_weight = 20;

/// Shares are chosen anew this often, as what the parts came out with differs from what their shares promised.
constexpr int share_rounds = 3;

/// A number that orders the parts differently in each round, no two alike; its low bits are the part. Exact in a Real.
Real drawn_number(int part, int round) {
  constexpr int part_bits = 24;
  std::uint64_t x = static_cast<std::uint64_t>(part) + 0x9E3779B97F4A7C15ULL * static_cast<std::uint64_t>(round + 1);
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  x ^= x >> 31;
  return static_cast<Real>(((x >> (64 - part_bits)) << part_bits) + static_cast<std::uint64_t>(part) + 1);
}

int part_of(Real drawn) {
  constexpr std::uint64_t mask = (std::uint64_t{1} << 24) - 1;
  return static_cast<int>(static_cast<std::uint64_t>(drawn) & mask) - 1;
}

/// The largest of the holders' values at each node.
void level_largest(const Mesh& mesh, std::vector<Real>& values) {
  mesh.node_halo.max_to_owners(std::span(values), 1);
  mesh.node_halo.update_copies(std::span(values), 1);
}

/// Work of each part. Collective.
std::vector<Real> sum_by_part(const Communicator& comm, std::span<const Real> work, std::span<const int> parts,
                              int n_parts) {
  std::vector<Real> loads(static_cast<std::size_t>(n_parts), 0);
  for (std::size_t e = 0; e < parts.size(); ++e) loads[static_cast<std::size_t>(parts[e])] += work[e];
  comm.sum_in_place(std::span<Real>(loads));
  return loads;
}

/// [node] 1 at the nodes between parts that are to be released, alike on all holders.
std::vector<std::uint8_t> mark_released(const Mesh& mesh, const AroundNodes& around,
                                        std::span<const std::uint8_t> wanted) {
  std::vector<Real> marks(index(mesh.nodes()), 0);
  for (std::size_t node = 0; node < marks.size(); ++node) marks[node] = wanted.empty() || wanted[node] != 0 ? 1 : 0;
  level_largest(mesh, marks);
  std::vector<std::uint8_t> released(marks.size(), 0);
  for (std::size_t node = 0; node < marks.size(); ++node)
    released[node] = marks[node] > 0 && !around.of(static_cast<LocalId>(node)).empty() ? 1 : 0;
  return released;
}

/// Who takes over at each released node, as drawn numbers; 0 elsewhere. beats(part, other, node): whether part does
/// where the two meet. Of more than two parts the one that beats most.
template <class Beats>
std::vector<Real> choose_winners(const Mesh& mesh, const AroundNodes& around, std::span<const std::uint8_t> released,
                                 int round, Beats&& beats) {
  std::vector<Real> winners(index(mesh.nodes()), 0);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (released[index(node)] == 0) continue;
    const auto here = around.of(node);
    std::pair<std::ptrdiff_t, Real> best = {-1, 0};
    for (const int part : here) {
      const auto beaten =
          std::count_if(here.begin(), here.end(), [&](int other) { return other != part && beats(part, other, node); });
      best = std::max(best, std::pair(beaten, drawn_number(part, round)));
    }
    winners[index(node)] = best.second;
  }
  return winners;
}

/// The parts after the winners have taken over the elements up to `layers` around their nodes: where several would, the
/// nearest, then the one drawn highest. Collective.
std::vector<int> take_over(const Mesh& mesh, std::vector<Real> winner, std::span<const int> parts, int layers) {
  std::vector<int> shifted(parts.begin(), parts.end());
  std::vector<std::uint8_t> is_taken(parts.size(), 0);
  for (int layer = 0; layer < layers; ++layer) {
    std::vector<Real> next(winner.size(), 0);
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (is_taken[index(e)] != 0) continue;
      Real highest = 0;
      for (const LocalId node : mesh.nodes_of_element(e)) highest = std::max(highest, winner[index(node)]);
      if (highest == 0) continue;
      is_taken[index(e)] = 1;
      shifted[index(e)] = part_of(highest);
      for (const LocalId node : mesh.nodes_of_element(e)) next[index(node)] = std::max(next[index(node)], highest);
    }
    level_largest(mesh, next);
    for (std::size_t node = 0; node < winner.size(); ++node) {
      if (winner[node] == 0) winner[node] = next[node];
    }
  }
  return shifted;
}

/// Makes faces at released nodes dear to cut.
void weigh_old_borders(const Mesh& mesh, std::span<const std::uint8_t> released, WorkGraph& graph) {
  for (LocalId e = 0; e < graph.owned(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t j = graph.first(e); j < graph.last(e); ++j) {
      for (int k = 0; k < mesh.dim; ++k) {
        const int corner = face_node(mesh.dim, graph.faces[j], k);
        graph.edge_weights[j] += old_node_weight * released[index(nodes[static_cast<std::size_t>(corner)])];
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

class InterfaceRelease {
 public:
  InterfaceRelease(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                   const Architecture& architecture, std::span<const int> parts, const ReleaseOptions& options,
                   std::span<const std::uint8_t> wanted)
      : comm_(comm),
        mesh_(mesh),
        work_(work),
        architecture_(architecture),
        parts_(parts),
        options_(options),
        around_(spread_split_nodes(comm, mesh, find_split_nodes(comm, mesh, parts))),
        released_(mark_released(mesh, around_, wanted)),
        total_(comm.sum(std::accumulate(work.begin(), work.end(), Real{0}))) {}

  Release run() {
    Release release;
    if (options_.aim == ReleaseAim::most_released) {
      const auto drawn_higher = [&](int part, int other, LocalId) {
        return drawn_number(part, options_.round) > drawn_number(other, options_.round);
      };
      release.parts = take_over(drawn_higher, options_.layers);
    } else {
      release.parts = take_shares();
    }
    if (options_.aim == ReleaseAim::equal_loads) {
      WorkGraph graph = build_work_graph(comm_, mesh_, work_);
      weigh_old_borders(mesh_, released_, graph);
      release.parts = level(comm_, graph, architecture_, std::move(release.parts), options_.tolerance);
    }
    count(release);
    return release;
  }

 private:
  template <class Beats>
  std::vector<int> take_over(Beats&& beats, int layers) const {
    return malleus::take_over(mesh_, choose_winners(mesh_, around_, released_, options_.round, beats), parts_, layers);
  }

  /// What the aim wants even: [part].
  std::vector<Real> measure(std::span<const int> parts) const {
    std::vector<Real> measures = sum_by_part(comm_, work_, parts, architecture_.parts());
    for (std::size_t p = 0; p < measures.size(); ++p)
      measures[p] -= total_ * architecture_.speed[p] / architecture_.total_speed();
    if (options_.aim == ReleaseAim::equal_loads) return measures;
    // Strips: the elements at released nodes stand for them.
    std::vector<Real> strip(work_.begin(), work_.end());
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      const auto nodes = mesh_.nodes_of_element(e);
      if (std::none_of(nodes.begin(), nodes.end(), [&](LocalId node) { return released_[index(node)] != 0; }))
        strip[index(e)] = 0;
    }
    return sum_by_part(comm_, strip, parts, architecture_.parts());
  }

  /// The measures if the higher part took over all along each border.
  std::vector<Real> start_measures(const BorderShares& shares) const {
    std::vector<Real> measures(static_cast<std::size_t>(architecture_.parts()), 0);
    const bool loads = options_.aim == ReleaseAim::equal_loads;
    if (loads) measures = measure(parts_);
    for (const auto& [pair, border] : shares.borders()) {
      measures[static_cast<std::size_t>(pair.first)] -= loads ? border.from_low : 0;
      measures[static_cast<std::size_t>(pair.second)] += loads ? border.from_low : border.work();
    }
    return measures;
  }

  std::vector<int> take_shares() const {
    BorderShares shares(comm_, mesh_, around_, released_, work_, parts_);
    const std::vector<Real> start = start_measures(shares);
    std::vector<Real> wanted = start;
    Real strips = 0;
    for (const auto& [pair, border] : shares.borders()) strips += border.work();
    const bool loads = options_.aim == ReleaseAim::equal_loads;
    const Real slack = loads ? 0.5 * options_.tolerance * total_ : 0.05 * strips;
    // The elements at the nodes tell of strips, too; how far these reach is for the end.
    const auto takes = [&](int part, int other, LocalId node) { return shares.takes(part, other, mesh_.point(node)); };
    std::vector<int> best;
    Real least = 0;
    for (int round = 0; round < share_rounds; ++round) {
      shares.level(wanted, slack / architecture_.parts());
      const std::vector<int> shifted = take_over(takes, loads ? options_.layers : 1);
      const std::vector<Real> came_out = measure(shifted);
      const Real worst = *std::max_element(came_out.begin(), came_out.end());
      if (best.empty() || worst < least) {
        least = worst;
        best = loads || options_.layers == 1 ? shifted : take_over(takes, options_.layers);
      }
      std::vector<Real> promised = start;
      for (const auto& [pair, border] : shares.borders()) {
        promised[static_cast<std::size_t>(pair.first)] += border.share * border.work();
        promised[static_cast<std::size_t>(pair.second)] -= border.share * border.work();
      }
      for (std::size_t p = 0; p < wanted.size(); ++p) wanted[p] = start[p] + came_out[p] - promised[p];
    }
    return best;
  }

  /// Counts what is new in release.parts.
  void count(Release& release) const {
    const SplitNodes split = find_split_nodes(comm_, mesh_, release.parts);
    release.still = comm_.sum(static_cast<GlobalId>(std::count_if(
        split.nodes.begin(), split.nodes.end(), [&](LocalId node) { return released_[index(node)] != 0; })));
    release.interface_nodes =
        comm_.sum(static_cast<GlobalId>(std::count(released_.begin(), released_.begin() + mesh_.owned_nodes(), 1)));
    GlobalId moved = 0;
    for (std::size_t e = 0; e < parts_.size(); ++e) moved += parts_[e] != release.parts[e] ? 1 : 0;
    release.moved_elements = comm_.sum(moved);
    const std::vector<Real> loads = sum_by_part(comm_, work_, release.parts, architecture_.parts());
    for (std::size_t p = 0; p < loads.size(); ++p) {
      const Real share = total_ * architecture_.speed[p] / architecture_.total_speed();
      if (share > 0) release.imbalance = std::max(release.imbalance, loads[p] / share - 1);
    }
  }

  const Communicator& comm_;
  const Mesh& mesh_;
  std::span<const Real> work_;
  const Architecture& architecture_;
  std::span<const int> parts_;
  const ReleaseOptions& options_;
  AroundNodes around_;
  std::vector<std::uint8_t> released_;
  Real total_;
};

}  // namespace

Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const Architecture& architecture, std::span<const int> parts,
                               const ReleaseOptions& options, std::span<const std::uint8_t> released) {
  return InterfaceRelease(comm, mesh, work, architecture, parts, options, released).run();
}

Release move_interfaces_inside(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                               const ReleaseOptions& options, std::span<const std::uint8_t> released) {
  const std::vector<int> here(static_cast<std::size_t>(mesh.elements()), comm.rank());
  const Architecture ranks = equal_architecture(comm.size());
  return InterfaceRelease(comm, mesh, work, ranks, here, options, released).run();
}

}  // namespace malleus
