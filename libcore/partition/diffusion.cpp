#include <algorithm>
#include <cmath>
#include <numeric>

#include "partition/pair_refiner.hpp"

namespace malleus {
namespace {

/// Largest share of a part that it may send in one round: beyond that parts empty and the flow's premises fail.
constexpr Real largest_share = 0.4;
constexpr int deepest_band = 40;

/// Sets of parts that hang together in the quotient graph: [part] the lowest part of its set.
std::vector<int> connected_sets(std::span<const QuotientEdge> edges, std::size_t parts) {
  std::vector<int> set(parts);
  std::iota(set.begin(), set.end(), 0);
  const auto root = [&](int p) {
    while (set[static_cast<std::size_t>(p)] != p) p = set[static_cast<std::size_t>(p)];
    return p;
  };
  for (const QuotientEdge& edge : edges) {
    const int a = root(edge.p);
    const int b = root(edge.q);
    set[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  }
  for (std::size_t p = 0; p < parts; ++p) set[p] = root(static_cast<int>(p));
  return set;
}

/// The excess of each part over its target, less the mean of its connected set: no flow can carry that away.
std::vector<Real> movable_excess(std::span<const QuotientEdge> edges, std::span<const Real> loads,
                                 std::span<const Real> targets) {
  const std::vector<int> set = connected_sets(edges, loads.size());
  std::vector<Real> sums(loads.size(), 0);
  std::vector<Real> counts(loads.size(), 0);
  std::vector<Real> excess(loads.size());
  for (std::size_t p = 0; p < loads.size(); ++p) {
    excess[p] = loads[p] - targets[p];
    sums[static_cast<std::size_t>(set[p])] += excess[p];
    counts[static_cast<std::size_t>(set[p])] += 1;
  }
  for (std::size_t p = 0; p < loads.size(); ++p) {
    const auto s = static_cast<std::size_t>(set[p]);
    excess[p] -= sums[s] / counts[s];
  }
  return excess;
}

Real dot(std::span<const Real> a, std::span<const Real> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), Real{0});
}

/// Solves L x = excess on the quotient graph, L the Laplacian with the links' bandwidths as conductances; the flow from
/// p to q is v_pq (x_p - x_q) (Hu and Blake, 1999). Conjugate gradients, alike on all ranks.
std::vector<Real> flow_potential(std::span<const QuotientEdge> edges, std::span<const Real> conductances,
                                 std::vector<Real> excess) {
  const std::size_t n = excess.size();
  std::vector<Real> x(n, 0);
  std::vector<Real> direction = excess;
  std::vector<Real> image(n);
  const Real first = dot(excess, excess);
  Real norm = first;
  for (std::size_t step = 0; step < 10 * n && norm > 1e-14 * first; ++step) {
    std::fill(image.begin(), image.end(), 0);
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const auto p = static_cast<std::size_t>(edges[i].p);
      const auto q = static_cast<std::size_t>(edges[i].q);
      const Real flow = conductances[i] * (direction[p] - direction[q]);
      image[p] += flow;
      image[q] -= flow;
    }
    const Real curvature = dot(direction, image);
    if (!(curvature > 0)) break;
    const Real length = norm / curvature;
    for (std::size_t p = 0; p < n; ++p) {
      x[p] += length * direction[p];
      excess[p] -= length * image[p];
    }
    const Real next = dot(excess, excess);
    for (std::size_t p = 0; p < n; ++p) direction[p] = excess[p] + next / norm * direction[p];
    norm = next;
  }
  return x;
}

}  // namespace

int PairRefiner::diffuse(Real tolerance, int rounds) {
  int round = 0;
  for (; round < rounds && imbalance() > tolerance; ++round) {
    const std::vector<QuotientEdge> edges = quotient();
    const std::vector<Real> excess = movable_excess(edges, loads_, targets_);
    std::vector<Real> conductances;
    for (const QuotientEdge& edge : edges) conductances.push_back(architecture_.relative_link(edge.p, edge.q));
    const std::vector<Real> potential = flow_potential(edges, conductances, excess);
    std::vector<Flow> flows;
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const auto p = static_cast<std::size_t>(edges[i].p);
      const auto q = static_cast<std::size_t>(edges[i].q);
      const Real flow = conductances[i] * (potential[p] - potential[q]);
      flows.push_back({edges[i], flow, std::max(potential[p], potential[q])});
    }
    if (send_flows(std::move(flows), tolerance) == 0) break;
  }
  count_.flow_rounds = std::max<GlobalId>(count_.flow_rounds, round);
  return round;
}

GlobalId PairRefiner::send_flows(std::vector<Flow> flows, Real tolerance) {
  const Real mean = std::accumulate(targets_.begin(), targets_.end(), Real{0}) / static_cast<Real>(targets_.size());
  std::erase_if(flows, [&](const Flow& flow) { return std::abs(flow.weight) < 0.1 * tolerance * mean; });
  std::stable_sort(flows.begin(), flows.end(), [](const Flow& a, const Flow& b) { return a.potential > b.potential; });
  std::vector<std::pair<int, int>> pairs;
  std::vector<Real> leaving(targets_.size(), 0);
  for (const Flow& flow : flows) {
    pairs.emplace_back(flow.edge.p, flow.edge.q);
    leaving[static_cast<std::size_t>(flow.weight > 0 ? flow.edge.p : flow.edge.q)] += std::abs(flow.weight);
  }
  GlobalId moved = 0;
  for (const std::vector<std::size_t>& round : disjoint_rounds(pairs, architecture_.parts())) {
    std::vector<PairGoal> goals;
    for (const std::size_t i : round) {
      const Flow& flow = flows[i];
      const int side = flow.weight > 0 ? 0 : 1;  // of the part that gives
      const auto giver = static_cast<std::size_t>(side == 0 ? flow.edge.p : flow.edge.q);
      const Real share = std::min(1.0, largest_share * loads_[giver] / leaving[giver]);
      const Real amount = flow.weight * share;
      PairGoal goal = {flow.edge.p, flow.edge.q, {0, 0}, {0, 0}, 0};
      goal.aims = {loads_[static_cast<std::size_t>(goal.p)] - amount,
                   loads_[static_cast<std::size_t>(goal.q)] + amount};
      goal.slack = {0.1 * tolerance * mean, 0.1 * tolerance * mean};
      const Real border = std::max(1.0, flow.edge.border[static_cast<std::size_t>(side)]);
      goal.depth = std::min(deepest_band, 3 + static_cast<int>(std::min(1e6, 1.5 * std::abs(amount) / border)));
      goals.push_back(goal);
    }
    for (const GlobalId changes : improve(goals, {1, 0, 1, 100})) moved += changes;
  }
  return moved;
}

}  // namespace malleus
