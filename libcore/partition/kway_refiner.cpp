#include "partition/kway_refiner.hpp"

#include <algorithm>
#include <queue>

#include "base/error.hpp"
#include "base/index.hpp"

namespace malleus {
namespace {

/// Where a vertex would go, and what that saves.
struct Move {
  int part = -1;  ///< -1: nowhere
  Real gain = 0;
};

/// A vertex that waits to be moved; out of date where the vertex has another version by now.
struct Waiting {
  Real gain;
  std::int64_t order;  ///< later ones first among equal gains: the search stays where it is
  LocalId vertex;
  std::int32_t version;
  bool operator<(const Waiting& other) const { return gain != other.gain ? gain < other.gain : order < other.order; }
};

struct Step {
  LocalId vertex;
  int from;
};

class KwaySearch {
 public:
  KwaySearch(const WorkGraph& graph, const Architecture& architecture, std::vector<int>& parts,
             std::vector<Real>& loads, std::span<const Real> targets, const KwaySettings& settings)
      : graph_(graph),
        architecture_(architecture),
        has_equal_links_(architecture.has_equal_links()),
        parts_(parts),
        loads_(loads),
        targets_(targets),
        settings_(settings),
        connection_(targets.size(), 0),
        touched_(parts.size(), 0),
        version_(parts.size(), 0) {
    for (const Real target : targets) limits_.push_back((1 + settings.tolerance) * target);
  }

  GlobalId run() {
    GlobalId moved = 0;
    for (round_ = 1; round_ <= settings_.rounds; ++round_) {
      GlobalId here = 0;
      for (const LocalId seed : shuffled_border()) here += search(seed);
      moved += here;
      if (here == 0) break;
    }
    return moved;
  }

 private:
  int part_of(LocalId v) const { return parts_[index(v)]; }

  bool is_at_border(LocalId v) const {
    for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
      if (part_of(graph_.neighbours[j]) != part_of(v)) return true;
    }
    return false;
  }

  /// The vertices at borders in an order of no meaning, another one in each round: searches then do not sweep along.
  std::vector<LocalId> shuffled_border() const {
    std::vector<LocalId> border;
    for (LocalId v = 0; v < graph_.owned(); ++v) {
      if (is_at_border(v)) border.push_back(v);
    }
    std::uint64_t state = 0x9E3779B97F4A7C15ULL * static_cast<std::uint64_t>(round_);
    for (std::size_t i = border.size(); i > 1; --i) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      std::swap(border[i - 1], border[(state >> 33) % i]);
    }
    return border;
  }

  bool may_go(Real weight, int from, int to) const {
    const auto f = static_cast<std::size_t>(from);
    const auto t = static_cast<std::size_t>(to);
    const Real there = loads_[t] + weight;
    if (there <= limits_[t]) return true;
    return loads_[f] > limits_[f] && there * targets_[f] < loads_[f] * targets_[t];
  }

  /// The best move of a vertex to a part that it touches; among equal ones to that with most room.
  Move best_move(LocalId v) {
    around_.clear();
    for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
      const int part = part_of(graph_.neighbours[j]);
      Real& connection = connection_[static_cast<std::size_t>(part)];
      if (connection == 0) around_.push_back(part);
      connection += graph_.edge_weights[j];
    }
    const int from = part_of(v);
    Move best;
    const Real cost_here = cost_in(from);
    for (const int part : around_) {
      if (part == from || !may_go(graph_.weights[index(v)], from, part)) continue;
      const Real gain = cost_here - cost_in(part);
      if (best.part < 0 || gain > best.gain || (gain == best.gain && room(part) > room(best.part))) best = {part, gain};
    }
    for (const int part : around_) connection_[static_cast<std::size_t>(part)] = 0;
    return best;
  }

  /// Cost of the edges of the vertex at hand, were it in a part, up to what is the same for all parts.
  Real cost_in(int part) const {
    if (has_equal_links_) return -connection_[static_cast<std::size_t>(part)] / architecture_.bandwidth;
    Real cost = 0;
    for (const int other : around_) {
      if (other != part) cost += connection_[static_cast<std::size_t>(other)] * architecture_.inverse_link(part, other);
    }
    return cost;
  }

  Real room(int part) const {
    const auto p = static_cast<std::size_t>(part);
    return limits_[p] - loads_[p];
  }

  void push(LocalId v) {
    if (touched_[index(v)] == round_) return;
    const Move move = best_move(v);
    ++version_[index(v)];
    if (move.part >= 0) queue_.push({move.gain, order_++, v, version_[index(v)]});
  }

  bool is_current(const Waiting& waiting) const {
    return touched_[index(waiting.vertex)] != round_ && waiting.version == version_[index(waiting.vertex)];
  }

  void move(LocalId v, int to) {
    const auto from = static_cast<std::size_t>(part_of(v));
    loads_[from] -= graph_.weights[index(v)];
    loads_[static_cast<std::size_t>(to)] += graph_.weights[index(v)];
    parts_[index(v)] = to;
  }

  /// Returns how many vertices changed part.
  GlobalId search(LocalId seed) {
    queue_ = {};
    steps_.clear();
    push(seed);
    Real gain = 0;
    Real best_gain = 0;
    std::size_t best_steps = 0;
    for (int left = settings_.patience; left > 0 && !queue_.empty();) {
      const Waiting top = queue_.top();
      queue_.pop();
      if (!is_current(top)) continue;
      const Move next = best_move(top.vertex);
      if (next.part < 0) continue;
      if (next.gain < top.gain) {  // where it wanted to go there is no more room
        push(top.vertex);
        continue;
      }
      take(top.vertex, next);
      gain += next.gain;
      --left;
      if (gain <= best_gain + least_gain) continue;
      best_gain = gain;
      best_steps = steps_.size();
      left = settings_.patience;
    }
    for (std::size_t i = steps_.size(); i > best_steps; --i) move(steps_[i - 1].vertex, steps_[i - 1].from);
    return static_cast<GlobalId>(best_steps);
  }

  void take(LocalId v, const Move& next) {
    touched_[index(v)] = round_;
    steps_.push_back({v, part_of(v)});
    move(v, next.part);
    for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) push(graph_.neighbours[j]);
  }

  static constexpr Real least_gain = 1e-9;

  const WorkGraph& graph_;
  const Architecture& architecture_;
  bool has_equal_links_;
  std::vector<int>& parts_;
  std::vector<Real>& loads_;
  std::span<const Real> targets_;
  const KwaySettings& settings_;
  std::vector<Real> limits_;
  std::vector<Real> connection_;       ///< [part] scratch: edges of the vertex at hand
  std::vector<int> around_;            ///< the parts for which it is not 0
  std::vector<int> touched_;           ///< [vertex] the round in which it was moved
  std::vector<std::int32_t> version_;  ///< [vertex] of its place in the queue
  std::priority_queue<Waiting> queue_;
  std::vector<Step> steps_;
  std::int64_t order_ = 0;
  int round_ = 0;
};

}  // namespace

GlobalId refine_kway(const WorkGraph& graph, const Architecture& architecture, std::vector<int>& parts,
                     std::vector<Real>& loads, std::span<const Real> targets, const KwaySettings& settings) {
  check(graph.copy_numbers.empty() && parts.size() == index(graph.owned()), "the graph lies on one rank");
  return KwaySearch(graph, architecture, parts, loads, targets, settings).run();
}

}  // namespace malleus
