#include "partition/strip_migration.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "partition/pair_refiner.hpp"

namespace malleus {
namespace {

using Pair = std::pair<int, int>;

/// What the strips of one side of a pair hold; strip s is at [s], the interface's own vertices being strip 0.
struct SideStrips {
  std::span<Real> weights;  ///< of the vertices
  std::span<Real> inner;    ///< edges to the next strip
  std::span<Real> third;    ///< cost added with other parts by going to the other side
};

/// A move of the strips 0..last from one part to the other.
struct StripMove {
  int from = 0;
  int to = 0;
  int last = -1;
  Real gain = 0;  ///< the friendship, where it is the best of the pair
};

class StripMigration {
 public:
  StripMigration(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                 std::vector<int> parts, const StripOptions& options)
      : comm_(comm), graph_(graph), architecture_(architecture), options_(options), parts_(std::move(parts)) {
    parts_.resize(static_cast<std::size_t>(graph.vertices()));
    graph.halo.update_copies(std::span<std::int32_t>(parts_), 1);
    goal_of_part_.assign(architecture.speed.size(), -1);
    for (LocalId v = 0; v < graph.owned(); ++v) {
      const bool is_at_copy = std::any_of(graph.neighbours.begin() + graph.start[static_cast<std::size_t>(v)],
                                          graph.neighbours.begin() + graph.start[static_cast<std::size_t>(v) + 1],
                                          [&](LocalId other) { return other >= graph.owned(); });
      if (is_at_copy) at_copies_.push_back(v);
    }
  }

  std::vector<int> run(StripReport& report) {
    for (; report.iterations < options_.most_iterations; ++report.iterations) {
      PairRefiner borders(comm_, graph_, architecture_, parts_, architecture_.speed);
      loads_ = borders.loads();
      const std::vector<StripMove> moves = form_pairs(borders.quotient());
      if (moves.empty()) break;
      make(moves);
      report.pairs += static_cast<GlobalId>(moves.size());
    }
    parts_.resize(static_cast<std::size_t>(graph_.owned()));
    return std::move(parts_);
  }

 private:
  int part_of(LocalId v) const { return parts_[static_cast<std::size_t>(v)]; }
  int goal_of(LocalId v) const { return goal_of_part_[static_cast<std::size_t>(part_of(v))]; }
  std::int32_t& distance(LocalId v) { return distances_[static_cast<std::size_t>(v)]; }
  Real time(int part, Real more = 0) const {
    const auto p = static_cast<std::size_t>(part);
    return (loads_[p] + more) / architecture_.speed[p];
  }

  /// The best move of each pair, those of most friendship first, no part in two of them.
  std::vector<StripMove> form_pairs(const std::vector<QuotientEdge>& edges) {
    std::vector<Pair> pairs;
    for (const QuotientEdge& edge : edges) pairs.emplace_back(edge.p, edge.q);
    std::vector<StripMove> moves;
    for (const std::vector<std::size_t>& round : disjoint_rounds(pairs, architecture_.parts())) {
      std::vector<QuotientEdge> goals;
      for (const std::size_t i : round) goals.push_back(edges[i]);
      for (const StripMove& move : best_moves(goals)) moves.push_back(move);
    }
    const Real total = std::accumulate(loads_.begin(), loads_.end(), Real{0});
    const Real least = options_.least_gain * total / architecture_.total_speed();
    std::erase_if(moves, [&](const StripMove& move) { return move.gain <= least; });
    std::stable_sort(moves.begin(), moves.end(),
                     [](const StripMove& a, const StripMove& b) { return a.gain > b.gain; });
    std::vector<char> is_taken(loads_.size(), 0);
    std::erase_if(moves, [&](const StripMove& move) {
      char& from = is_taken[static_cast<std::size_t>(move.from)];
      char& to = is_taken[static_cast<std::size_t>(move.to)];
      if (from != 0 || to != 0) return true;
      from = to = 1;
      return false;
    });
    return moves;
  }

  /// The better of the two directions for each of some disjoint pairs.
  std::vector<StripMove> best_moves(const std::vector<QuotientEdge>& goals) {
    set_goals(goals);
    find_distances();
    const auto strips = static_cast<std::size_t>(options_.most_strips);
    std::vector<Real> sums(goals.size() * 2 * 3 * strips, 0);
    const auto side_strips = [&](std::size_t goal, int side) {
      const std::span<Real> all(sums);
      const std::size_t first = (goal * 2 + static_cast<std::size_t>(side)) * 3 * strips;
      return SideStrips{all.subspan(first, strips), all.subspan(first + strips, strips),
                        all.subspan(first + 2 * strips, strips)};
    };
    for (LocalId v = 0; v < graph_.owned(); ++v) {
      if (goal_of(v) < 0 || distance(v) < 0) continue;
      const auto g = static_cast<std::size_t>(goal_of(v));
      add_vertex(v, goals[g], side_strips(g, part_of(v) == goals[g].p ? 0 : 1));
    }
    comm_.sum_in_place(std::span<Real>(sums));
    std::vector<StripMove> moves;
    for (std::size_t g = 0; g < goals.size(); ++g) {
      const StripMove there = best_move(goals[g], goals[g].p, goals[g].q, side_strips(g, 0));
      const StripMove back = best_move(goals[g], goals[g].q, goals[g].p, side_strips(g, 1));
      moves.push_back(there.gain >= back.gain ? there : back);
    }
    return moves;
  }

  void set_goals(const std::vector<QuotientEdge>& goals) {
    std::fill(goal_of_part_.begin(), goal_of_part_.end(), -1);
    for (std::size_t g = 0; g < goals.size(); ++g) {
      goal_of_part_[static_cast<std::size_t>(goals[g].p)] = static_cast<int>(g);
      goal_of_part_[static_cast<std::size_t>(goals[g].q)] = static_cast<int>(g);
    }
  }

  void add_vertex(LocalId v, const QuotientEdge& goal, const SideStrips& side) {
    const auto s = static_cast<std::size_t>(distance(v));
    const int here = part_of(v);
    const int there = here == goal.p ? goal.q : goal.p;
    side.weights[s] += graph_.weights[static_cast<std::size_t>(v)];
    for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
      const LocalId other = graph_.neighbours[j];
      const int part = part_of(other);
      const Real cost = options_.edge_cost * graph_.edge_weights[j];
      if (part == here) {
        const std::int32_t d = distance(other);
        if (d < 0 || d > distance(v)) side.inner[s] += cost;
      } else if (part != there) {
        side.third[s] += cost * (architecture_.inverse_link(there, part) - architecture_.inverse_link(here, part));
      }
    }
  }

  /// Eq. (16) strip by strip.
  StripMove best_move(const QuotientEdge& goal, int from, int to, const SideStrips& side) const {
    const Real link = architecture_.inverse_link(from, to);
    const Real now = std::max(time(from), time(to)) + options_.edge_cost * goal.weight * link;
    StripMove best = {from, to, -1, 0};
    Real moved = 0;
    Real third = 0;
    for (std::size_t s = 0; s < side.weights.size(); ++s) {
      moved += side.weights[s];
      third += side.third[s];
      const Real then = std::max(time(from, -moved), time(to, moved)) + side.inner[s] * link + third;
      if (now - then > best.gain) best = {from, to, static_cast<int>(s), now - then};
      if (time(to, moved) > now || side.inner[s] <= 0) break;
    }
    return best;
  }

  /// Steps from the interface of its pair, for each vertex of a goal's parts; -1 beyond the last strip.
  void find_distances() {
    distances_.assign(parts_.size(), -1);
    std::vector<LocalId> layer;
    for (LocalId v = 0; v < graph_.owned(); ++v) {
      if (goal_of(v) < 0) continue;
      for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
        const LocalId other = graph_.neighbours[j];
        if (part_of(other) == part_of(v) || goal_of(other) != goal_of(v)) continue;
        distance(v) = 0;
        layer.push_back(v);
        break;
      }
    }
    for (int step = 1; step < options_.most_strips && comm_.any(!layer.empty()); ++step) {
      graph_.halo.update_copies(std::span<std::int32_t>(distances_), 1);
      std::vector<LocalId> next;
      const auto reach = [&](LocalId v) {
        distance(v) = step;
        next.push_back(v);
      };
      for (const LocalId v : layer) {
        for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
          const LocalId other = graph_.neighbours[j];
          if (other < graph_.owned() && part_of(other) == part_of(v) && distance(other) < 0) reach(other);
        }
      }
      for (const LocalId v : at_copies_) {
        if (distance(v) >= 0 || goal_of(v) < 0) continue;
        for (std::size_t j = graph_.first(v); j < graph_.last(v) && distance(v) < 0; ++j) {
          const LocalId other = graph_.neighbours[j];
          if (other >= graph_.owned() && part_of(other) == part_of(v) && distance(other) == step - 1) reach(v);
        }
      }
      layer = std::move(next);
    }
    graph_.halo.update_copies(std::span<std::int32_t>(distances_), 1);
  }

  void make(const std::vector<StripMove>& moves) {
    std::vector<QuotientEdge> goals;
    for (const StripMove& move : moves) {
      goals.push_back({std::min(move.from, move.to), std::max(move.from, move.to), 0, {0, 0}});
    }
    set_goals(goals);
    find_distances();
    for (LocalId v = 0; v < graph_.owned(); ++v) {
      if (goal_of(v) < 0 || distance(v) < 0) continue;
      const StripMove& move = moves[static_cast<std::size_t>(goal_of(v))];
      if (part_of(v) == move.from && distance(v) <= move.last) parts_[static_cast<std::size_t>(v)] = move.to;
    }
    graph_.halo.update_copies(std::span<std::int32_t>(parts_), 1);
  }

  const Communicator& comm_;
  const WorkGraph& graph_;
  const Architecture& architecture_;
  const StripOptions& options_;
  std::vector<int> parts_;
  std::vector<Real> loads_;
  std::vector<int> goal_of_part_;
  std::vector<std::int32_t> distances_;
  std::vector<LocalId> at_copies_;  ///< owned vertices next to another rank's
};

}  // namespace

std::vector<int> migrate_strips(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                std::vector<int> parts, const StripOptions& options, StripReport& report) {
  return StripMigration(comm, graph, architecture, std::move(parts), options).run(report);
}

}  // namespace malleus
