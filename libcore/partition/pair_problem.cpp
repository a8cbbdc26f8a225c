#include "partition/pair_problem.hpp"

#include <algorithm>
#include <queue>

namespace malleus {
namespace {

struct Candidate {
  Real gain;
  std::int64_t order;  ///< later ones first among equal gains: the search stays where it is
  LocalId vertex;
  bool operator<(const Candidate& other) const { return gain != other.gain ? gain < other.gain : order < other.order; }
};

/// One pass over a problem.
class Pass {
 public:
  Pass(PairProblem& problem, int stall)
      : p_(problem), stall_(stall), gains_(problem.size()), is_locked_(problem.size(), 0) {
    for (LocalId v = 0; v < static_cast<LocalId>(problem.size()); ++v) {
      bool is_border = false;
      gains_[at(v)] = first_gain(v, is_border);
      if (is_border) push(v);
    }
  }

  /// Returns whether something better was found.
  bool run() {
    const Real first_overload = overload();
    Real best_overload = first_overload;
    Real gain = 0;
    Real best_gain = 0;
    std::size_t best_moves = 0;
    for (int left = stall_; left > 0;) {
      const int from = choose_side();
      if (from < 0) break;
      const LocalId vertex = queues_[from].top().vertex;
      queues_[from].pop();
      gain += gains_[at(vertex)];
      move(vertex);
      const Real now = overload();
      if (now < best_overload || (now == best_overload && gain > best_gain + 1e-9)) {
        best_overload = now;
        best_gain = gain;
        best_moves = moves_.size();
        left = stall_;
      } else {
        --left;
      }
    }
    for (std::size_t i = moves_.size(); i > best_moves; --i) flip(moves_[i - 1]);
    moves_.resize(best_moves);
    return best_moves > 0;
  }

 private:
  static std::size_t at(LocalId v) { return static_cast<std::size_t>(v); }
  std::size_t first(LocalId v) const { return static_cast<std::size_t>(p_.start[at(v)]); }
  std::size_t last(LocalId v) const { return static_cast<std::size_t>(p_.start[at(v) + 1]); }

  Real first_gain(LocalId v, bool& is_border) const {
    const auto side = static_cast<std::size_t>(p_.sides[at(v)]);
    Real gain = p_.outside[at(v)][1 - side] - p_.outside[at(v)][side];
    is_border = p_.outside[at(v)][1 - side] > 0;
    for (std::size_t j = first(v); j < last(v); ++j) {
      const bool is_across = p_.sides[at(p_.neighbours[j])] != p_.sides[at(v)];
      is_border = is_border || is_across;
      gain += is_across ? p_.edge_weights[j] : -p_.edge_weights[j];
    }
    return gain * p_.link_cost + (side == 0 ? p_.third[at(v)] : -p_.third[at(v)]);
  }

  void push(LocalId v) { queues_[p_.sides[at(v)]].push({gains_[at(v)], order_++, v}); }

  Real overload() const {
    return std::max(0.0, p_.loads[0] - p_.aims[0] - p_.slack[0]) +
           std::max(0.0, p_.loads[1] - p_.aims[1] - p_.slack[1]);
  }
  bool is_over(std::size_t side, Real more) const { return p_.loads[side] + more > p_.aims[side] + p_.slack[side]; }
  Real relative_load(std::size_t side) const { return p_.loads[side] / std::max(1.0, p_.aims[side]); }

  /// Removes what is out of date from the top.
  bool has_candidate(int side) {
    auto& queue = queues_[side];
    while (!queue.empty()) {
      const Candidate& top = queue.top();
      if (is_locked_[at(top.vertex)] == 0 && top.gain == gains_[at(top.vertex)]) return true;
      queue.pop();
    }
    return false;
  }

  bool may_leave(int side) {
    if (!has_candidate(side)) return false;
    const auto here = static_cast<std::size_t>(side);
    const Real weight = p_.weights[at(queues_[side].top().vertex)];
    if (!is_over(1 - here, weight)) return true;
    return is_over(here, 0) && relative_load(1 - here) < relative_load(here);
  }

  /// The side whose best vertex goes next, -1 where none may.
  int choose_side() {
    const bool may[2] = {may_leave(0), may_leave(1)};
    if (!may[0] && !may[1]) return -1;
    if (may[0] != may[1]) return may[0] ? 0 : 1;
    if (is_over(0, 0)) return 0;
    if (is_over(1, 0)) return 1;
    const Real gains[2] = {queues_[0].top().gain, queues_[1].top().gain};
    if (gains[0] != gains[1]) return gains[0] > gains[1] ? 0 : 1;
    return relative_load(0) >= relative_load(1) ? 0 : 1;
  }

  void flip(LocalId v) {
    const auto from = static_cast<std::size_t>(p_.sides[at(v)]);
    p_.loads[from] -= p_.weights[at(v)];
    p_.loads[1 - from] += p_.weights[at(v)];
    p_.sides[at(v)] = static_cast<std::uint8_t>(1 - from);
  }

  void move(LocalId v) {
    is_locked_[at(v)] = 1;
    moves_.push_back(v);
    flip(v);
    for (std::size_t j = first(v); j < last(v); ++j) {
      const LocalId other = p_.neighbours[j];
      if (is_locked_[at(other)] != 0) continue;
      const bool is_across = p_.sides[at(other)] != p_.sides[at(v)];
      gains_[at(other)] += 2 * p_.link_cost * (is_across ? p_.edge_weights[j] : -p_.edge_weights[j]);
      push(other);
    }
  }

  PairProblem& p_;
  int stall_;
  std::vector<Real> gains_;
  std::vector<char> is_locked_;
  std::priority_queue<Candidate> queues_[2];
  std::int64_t order_ = 0;
  std::vector<LocalId> moves_;
};

}  // namespace

LocalId refine_pair(PairProblem& problem, int passes, int stall) {
  const std::vector<std::uint8_t> before = problem.sides;
  for (int pass = 0; pass < passes; ++pass) {
    if (!Pass(problem, stall).run()) break;
  }
  LocalId changed = 0;
  for (std::size_t v = 0; v < before.size(); ++v) changed += before[v] != problem.sides[v] ? 1 : 0;
  return changed;
}

}  // namespace malleus
