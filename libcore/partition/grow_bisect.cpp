#include "partition/grow_bisect.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include "base/error.hpp"
#include "base/index.hpp"
#include "partition/pair_problem.hpp"
#include "partition/replicate.hpp"

namespace malleus {
namespace {

/// Halves grown from different vertices: as many as look at so many vertices, within bounds.
constexpr std::size_t tried_vertices = 20000;
constexpr std::size_t fewest_tries = 4;
constexpr std::size_t most_tries = 10;
constexpr int refinement_passes = 4;
constexpr int refinement_stall = 100;
/// Of a half's weight: what it may exceed its aim by, in each bisection.
constexpr Real slack_share = 0.005;

/// A set of vertices that is to be divided among the parts [first, last).
struct Set {
  std::vector<LocalId> vertices;
  int first = 0;
  int last = 0;
};

/// A vertex that touches the half that grows.
struct Reached {
  Real gain;
  std::int64_t order;  ///< earlier ones first among equal gains: the half grows round
  LocalId vertex;
  bool operator<(const Reached& other) const { return gain != other.gain ? gain < other.gain : order > other.order; }
};

class GrowBisector {
 public:
  GrowBisector(const WorkGraph& graph, std::span<const Real> shares)
      : graph_(graph), shares_(shares), place_(graph.weights.size(), -1), parts_(graph.weights.size(), 0) {}

  std::vector<int> run() {
    Set all = {std::vector<LocalId>(parts_.size()), 0, static_cast<int>(shares_.size())};
    std::iota(all.vertices.begin(), all.vertices.end(), 0);
    std::vector<Set> waiting = {std::move(all)};
    while (!waiting.empty()) {
      const Set set = std::move(waiting.back());
      waiting.pop_back();
      if (set.last - set.first == 1) {
        for (const LocalId v : set.vertices) parts_[index(v)] = set.first;
        continue;
      }
      const int middle = (set.first + set.last) / 2;
      const std::vector<std::uint8_t> sides = halve(set, middle);
      Set halves[2] = {{{}, set.first, middle}, {{}, middle, set.last}};
      for (std::size_t i = 0; i < sides.size(); ++i) halves[sides[i]].vertices.push_back(set.vertices[i]);
      for (Set& half : halves) waiting.push_back(std::move(half));
    }
    return std::move(parts_);
  }

 private:
  Real share(int first, int last) const {
    return std::accumulate(shares_.begin() + first, shares_.begin() + last, Real{0});
  }

  /// The set with the edges inside it, all on side 1.
  PairProblem make_problem(const Set& set, int middle) {
    PairProblem problem;
    for (std::size_t i = 0; i < set.vertices.size(); ++i) place_[index(set.vertices[i])] = static_cast<LocalId>(i);
    problem.start.assign(1, 0);
    for (const LocalId v : set.vertices) {
      problem.weights.push_back(graph_.weights[index(v)]);
      for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
        const LocalId other = place_[index(graph_.neighbours[j])];
        if (other < 0) continue;
        problem.neighbours.push_back(other);
        problem.edge_weights.push_back(graph_.edge_weights[j]);
      }
      problem.start.push_back(static_cast<std::int64_t>(problem.neighbours.size()));
    }
    for (const LocalId v : set.vertices) place_[index(v)] = -1;
    problem.sides.assign(set.vertices.size(), 1);
    problem.outside.assign(set.vertices.size(), {0, 0});
    problem.third.assign(set.vertices.size(), 0);
    const Real total = std::accumulate(problem.weights.begin(), problem.weights.end(), Real{0});
    const Real lower = total * share(set.first, middle) / share(set.first, set.last);
    problem.aims = {lower, total - lower};
    problem.slack = {slack_share * lower, slack_share * (total - lower)};
    problem.loads = {0, total};
    return problem;
  }

  std::vector<std::uint8_t> halve(const Set& set, int middle) {
    const PairProblem start = make_problem(set, middle);
    PairProblem problem = start;
    std::vector<std::uint8_t> best;
    std::pair<Real, Real> least = {0, 0};
    if (set.vertices.empty()) return best;
    const auto tries = static_cast<int>(std::clamp(tried_vertices / set.vertices.size(), fewest_tries, most_tries));
    for (int attempt = 0; attempt < tries; ++attempt) {
      problem.sides = start.sides;
      problem.loads = start.loads;
      grow(problem, seed(problem, attempt));
      refine_pair(problem, refinement_passes, refinement_stall);
      const std::pair<Real, Real> cost = {overload(problem), cut(problem)};
      if (!best.empty() && cost >= least) continue;
      least = cost;
      best = problem.sides;
    }
    return best;
  }

  /// Too much weight on a side, in steps so coarse that the cut decides among what is about as even.
  static Real overload(const PairProblem& p) {
    Real worst = 0;
    for (std::size_t side = 0; side < 2; ++side)
      worst = std::max(worst, (p.loads[side] - p.aims[side]) / std::max(1.0, p.slack[side]));
    return std::floor(worst / 4);
  }

  static Real cut(const PairProblem& p) {
    Real weight = 0;
    for (std::size_t v = 0; v < p.size(); ++v) {
      for (auto j = p.start[v]; j < p.start[v + 1]; ++j) {
        const auto other = index(p.neighbours[static_cast<std::size_t>(j)]);
        if (p.sides[v] != p.sides[other]) weight += p.edge_weights[static_cast<std::size_t>(j)];
      }
    }
    return weight / 2;
  }

  /// A vertex from which a half is grown: first one far from the others, then any.
  static LocalId seed(const PairProblem& p, int attempt) {
    const auto n = static_cast<std::uint64_t>(p.size());
    std::uint64_t state = 0x9E3779B97F4A7C15ULL * static_cast<std::uint64_t>(attempt + 1) + n;
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    LocalId vertex = static_cast<LocalId>((state >> 33) % n);
    for (int step = 0; step < (attempt % 2 == 0 ? 2 : 0); ++step) vertex = farthest(p, vertex);
    return vertex;
  }

  static LocalId farthest(const PairProblem& p, LocalId from) {
    std::vector<char> is_seen(p.size(), 0);
    std::vector<LocalId> queue = {from};
    is_seen[index(from)] = 1;
    for (std::size_t next = 0; next < queue.size(); ++next) {
      const auto v = index(queue[next]);
      for (auto j = p.start[v]; j < p.start[v + 1]; ++j) {
        const LocalId other = p.neighbours[static_cast<std::size_t>(j)];
        if (is_seen[index(other)] != 0) continue;
        is_seen[index(other)] = 1;
        queue.push_back(other);
      }
    }
    return queue.back();
  }

  /// Moves vertices from side 1 to side 0, from the seed on, until side 0 has what it should.
  static void grow(PairProblem& p, LocalId seed) {
    std::vector<Real> inward(p.size(), 0);  // edges to side 0
    std::vector<Real> degree(p.size(), 0);
    for (std::size_t v = 0; v < p.size(); ++v) {
      for (auto j = p.start[v]; j < p.start[v + 1]; ++j) degree[v] += p.edge_weights[static_cast<std::size_t>(j)];
    }
    std::priority_queue<Reached> queue;
    std::int64_t order = 0;
    std::size_t untouched = 0;
    queue.push({0, order++, seed});
    while (p.loads[0] < p.aims[0]) {
      while (queue.empty() && untouched < p.size()) {  // another body
        if (p.sides[untouched] == 1) queue.push({0, order++, static_cast<LocalId>(untouched)});
        ++untouched;
      }
      if (queue.empty()) return;
      const LocalId v = queue.top().vertex;
      queue.pop();
      if (p.sides[index(v)] == 0) continue;
      const Real weight = p.weights[index(v)];
      if (p.loads[0] + weight - p.aims[0] > p.aims[0] - p.loads[0]) continue;
      p.sides[index(v)] = 0;
      p.loads[0] += weight;
      p.loads[1] -= weight;
      for (auto j = p.start[index(v)]; j < p.start[index(v) + 1]; ++j) {
        const LocalId other = p.neighbours[static_cast<std::size_t>(j)];
        if (p.sides[index(other)] == 0) continue;
        inward[index(other)] += p.edge_weights[static_cast<std::size_t>(j)];
        queue.push({2 * inward[index(other)] - degree[index(other)], order++, other});
      }
    }
  }

  const WorkGraph& graph_;
  std::span<const Real> shares_;
  std::vector<LocalId> place_;  ///< [vertex] scratch: in the set at hand, -1 elsewhere
  std::vector<int> parts_;
};

}  // namespace

std::vector<int> grow_bisect(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares) {
  check(!shares.empty(), "there is at least one part");
  if (comm.size() == 1) return GrowBisector(graph, shares).run();
  const Communicator alone(MPI_COMM_SELF);
  const WorkGraph whole = replicate_graph(comm, alone, graph);
  const std::vector<int> parts = GrowBisector(whole, shares).run();
  const auto first = parts.begin() + graph.ownership.begin();
  return {first, first + graph.owned()};
}

}  // namespace malleus
