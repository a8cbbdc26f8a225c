#include "partition/pair_refiner.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "parallel/gather.hpp"
#include "parallel/sparse_exchange.hpp"
#include "partition/partition_cost.hpp"
#include "partition/pieces.hpp"

namespace malleus {

PairRefiner::PairRefiner(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                         std::vector<int> parts, std::vector<Real> targets)
    : comm_(comm), graph_(graph), architecture_(architecture), targets_(std::move(targets)) {
  goal_of_part_.assign(targets_.size(), -1);
  start(std::move(parts));
  list_copy_neighbours();
}

void PairRefiner::start(std::vector<int> parts) {
  check(parts.size() == static_cast<std::size_t>(graph_.vertices()), "each vertex has a part, copies too");
  parts_ = std::move(parts);
  loads_ = part_loads(comm_, graph_, parts_, architecture_.parts());
  mark_.assign(parts_.size(), 0);
  place_.assign(static_cast<std::size_t>(graph_.owned()), 0);
  round_ = 0;
  handed_.assign(comm_.size() > 1 ? parts_.size() : 0, 0);
  candidates_.clear();
  recent_.clear();
  borders_.clear();
  find_candidates();
}

void RefinementCount::add(const RefinementCount& other) {
  rounds += other.rounds;
  flow_rounds = std::max(flow_rounds, other.flow_rounds);
  pairs += other.pairs;
  moved_vertices += other.moved_vertices;
  messages += other.messages;
  bytes += other.bytes;
}

Real PairRefiner::imbalance() const {
  Real worst = 0;
  for (std::size_t p = 0; p < loads_.size(); ++p) {
    if (targets_[p] > 0) worst = std::max(worst, loads_[p] / targets_[p] - 1);
  }
  return worst;
}

bool PairRefiner::touches(LocalId vertex, int part) const {
  for (std::size_t j = graph_.first(vertex); j < graph_.last(vertex); ++j) {
    if (part_of(graph_.neighbours[j]) == part) return true;
  }
  return false;
}

void PairRefiner::find_candidates() {
  is_candidate_.assign(static_cast<std::size_t>(graph_.owned()), 0);
  is_recent_.assign(is_candidate_.size(), 0);
  for (LocalId v = 0; v < graph_.owned(); ++v) {
    for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
      if (part_of(graph_.neighbours[j]) == part_of(v)) continue;
      is_candidate_[static_cast<std::size_t>(v)] = 1;
      candidates_.push_back(v);
      break;
    }
  }
}

void PairRefiner::list_copy_neighbours() {
  copy_start_.assign(graph_.copy_numbers.size() + 1, 0);
  const auto for_each_copy = [&](auto visit) {
    for (LocalId v = 0; v < graph_.owned(); ++v) {
      for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
        if (graph_.neighbours[j] >= graph_.owned()) {
          visit(static_cast<std::size_t>(graph_.neighbours[j] - graph_.owned()), v);
        }
      }
    }
  };
  for_each_copy([&](std::size_t copy, LocalId) { ++copy_start_[copy + 1]; });
  std::partial_sum(copy_start_.begin(), copy_start_.end(), copy_start_.begin());
  copy_neighbours_.resize(static_cast<std::size_t>(copy_start_.back()));
  std::vector<std::int64_t> next(copy_start_.begin(), copy_start_.end() - 1);
  for_each_copy([&](std::size_t copy, LocalId v) { copy_neighbours_[static_cast<std::size_t>(next[copy]++)] = v; });
}

/// The vertex, which may be a copy, has changed part: it and its neighbours may be at other borders now.
void PairRefiner::note_change(LocalId vertex) {
  const auto add = [&](LocalId v) {
    if (v >= graph_.owned()) return;
    if (char& is_known = is_candidate_[static_cast<std::size_t>(v)]; is_known == 0) {
      is_known = 1;
      candidates_.push_back(v);
    }
    if (char& is_known = is_recent_[static_cast<std::size_t>(v)]; is_known == 0) {
      is_known = 1;
      recent_.push_back(v);
    }
  };
  if (vertex < graph_.owned()) {
    add(vertex);
    for (std::size_t j = graph_.first(vertex); j < graph_.last(vertex); ++j) add(graph_.neighbours[j]);
    return;
  }
  const auto copy = static_cast<std::size_t>(vertex - graph_.owned());
  for (auto j = copy_start_[copy]; j < copy_start_[copy + 1]; ++j) add(copy_neighbours_[static_cast<std::size_t>(j)]);
}

void PairRefiner::update_copies_of_parts() {
  if (comm_.size() == 1) return;
  const std::vector<int> before(parts_.begin() + graph_.owned(), parts_.end());
  graph_.halo.update_copies(std::span<std::int32_t>(parts_), 1);
  for (std::size_t copy = 0; copy < before.size(); ++copy) {
    const LocalId vertex = graph_.owned() + static_cast<LocalId>(copy);
    if (part_of(vertex) != before[copy]) note_change(vertex);
  }
}

/// The borders as this rank sees them, and the vertices at each.
std::vector<QuotientEdge> PairRefiner::local_quotient() {
  struct Border {
    QuotientEdge edge;
    std::vector<LocalId> vertices;
  };
  std::vector<std::vector<Border>> by_lower_part(targets_.size());
  const auto find = [&](int p, int q) -> Border& {
    std::vector<Border>& borders = by_lower_part[static_cast<std::size_t>(p)];
    for (Border& border : borders) {
      if (border.edge.q == q) return border;
    }
    return borders.emplace_back(Border{{p, q, 0, {0, 0}}, {}});
  };
  std::vector<LocalId> still;
  for (const LocalId v : candidates_) {
    const int part = part_of(v);
    bool is_border = false;
    for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
      const int other = part_of(graph_.neighbours[j]);
      if (other == part) continue;
      is_border = true;
      Border& border = find(std::min(part, other), std::max(part, other));
      if (part < other) border.edge.weight += graph_.edge_weights[j];
      if (!border.vertices.empty() && border.vertices.back() == v) continue;
      border.vertices.push_back(v);
      border.edge.border[part < other ? 0 : 1] += graph_.weights[static_cast<std::size_t>(v)];
    }
    is_candidate_[static_cast<std::size_t>(v)] = is_border ? 1 : 0;
    if (is_border) still.push_back(v);
  }
  candidates_ = std::move(still);
  for (const LocalId v : recent_) is_recent_[static_cast<std::size_t>(v)] = 0;
  recent_.clear();
  borders_.clear();
  std::vector<QuotientEdge> edges;
  for (std::vector<Border>& borders : by_lower_part) {
    for (Border& border : borders) {
      edges.push_back(border.edge);
      borders_[{border.edge.p, border.edge.q}] = std::move(border.vertices);
    }
  }
  return edges;
}

std::vector<QuotientEdge> PairRefiner::quotient() {
  std::vector<QuotientEdge> edges = gather_lists<QuotientEdge>(comm_, local_quotient());
  std::stable_sort(edges.begin(), edges.end(), [](const QuotientEdge& a, const QuotientEdge& b) {
    return std::pair(a.p, a.q) < std::pair(b.p, b.q);
  });
  std::vector<QuotientEdge> merged;
  for (const QuotientEdge& edge : edges) {
    if (merged.empty() || merged.back().p != edge.p || merged.back().q != edge.q) {
      merged.push_back(edge);
      continue;
    }
    merged.back().weight += edge.weight;
    merged.back().border[0] += edge.border[0];
    merged.back().border[1] += edge.border[1];
  }
  return merged;
}

void PairRefiner::mark(LocalId vertex, std::vector<LocalId>& layer) {
  std::int32_t& mark = mark_[static_cast<std::size_t>(vertex)];
  if (mark == round_) return;
  mark = round_;
  if (vertex < graph_.owned()) {
    layer.push_back(vertex);
  } else {
    handed_[static_cast<std::size_t>(vertex)] = 1;
  }
}

void PairRefiner::hand_marks_to_owners(std::vector<LocalId>& layer) {
  if (comm_.size() == 1) return;
  graph_.halo.max_to_owners(handed_, 1);
  for (const Halo::Partner& partner : graph_.halo.partners()) {
    for (const LocalId vertex : partner.sends) {
      if (handed_[static_cast<std::size_t>(vertex)] > 0) mark(vertex, layer);
    }
  }
  for (const Halo::Partner& partner : graph_.halo.partners()) {
    for (const LocalId vertex : partner.sends) handed_[static_cast<std::size_t>(vertex)] = 0;
  }
  std::fill(handed_.begin() + graph_.owned(), handed_.end(), 0);
}

/// Marks those of the vertices that are at the border of the pair.
void PairRefiner::mark_seeds(const PairGoal& goal, std::span<const LocalId> vertices, std::vector<LocalId>& layer) {
  for (const LocalId v : vertices) {
    const int part = part_of(v);
    if (part == goal.p ? touches(v, goal.q) : part == goal.q && touches(v, goal.p)) mark(v, layer);
  }
}

std::vector<LocalId> PairRefiner::mark_bands(std::span<const PairGoal> goals) {
  ++round_;
  std::vector<LocalId> layer;
  for (const PairGoal& goal : goals) {
    const auto border = borders_.find({goal.p, goal.q});
    if (border != borders_.end()) mark_seeds(goal, border->second, layer);
  }
  for (const LocalId v : recent_) {
    if (goal_of(v) >= 0) mark_seeds(goals[static_cast<std::size_t>(goal_of(v))], {&v, 1}, layer);
  }
  int deepest = 1;
  for (const PairGoal& goal : goals) deepest = std::max(deepest, goal.depth);
  std::vector<LocalId> band = layer;
  for (int step = 1; step < deepest; ++step) {
    std::vector<LocalId> next;
    for (const LocalId v : layer) {
      const int g = goal_of(v);
      if (goals[static_cast<std::size_t>(g)].depth <= step) continue;
      for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
        if (goal_of(graph_.neighbours[j]) == g) mark(graph_.neighbours[j], next);
      }
    }
    hand_marks_to_owners(next);
    band.insert(band.end(), next.begin(), next.end());
    layer = std::move(next);
  }
  graph_.halo.update_copies(std::span<std::int32_t>(mark_), 1);
  return band;
}

PairRefiner::PieceLists PairRefiner::cut_pieces(std::span<const PairGoal> goals, std::span<const LocalId> band) {
  std::vector<std::array<std::size_t, 2>> sizes(goals.size(), {0, 0});  // vertices and edges
  for (const LocalId v : band) {
    std::array<std::size_t, 2>& size = sizes[static_cast<std::size_t>(goal_of(v))];
    place_[static_cast<std::size_t>(v)] = static_cast<LocalId>(size[0]++);
    size[1] += graph_.last(v) - graph_.first(v);
  }
  std::vector<BandPiece> pieces(goals.size());
  for (std::size_t g = 0; g < goals.size(); ++g) pieces[g].reserve(sizes[g][0], sizes[g][1]);
  for (const LocalId v : band) {
    const auto g = static_cast<std::size_t>(goal_of(v));
    add_to_piece(v, goals[g], pieces[g]);
  }
  PieceLists lists;
  for (std::size_t g = 0; g < goals.size(); ++g) {
    if (!pieces[g].numbers.empty()) lists[static_cast<int>(g)].push_back(std::move(pieces[g]));
  }
  return lists;
}

void PairRefiner::add_to_piece(LocalId v, const PairGoal& goal, BandPiece& piece) const {
  const bool has_third = !architecture_.has_equal_links();
  std::array<Real, 2> outside = {0, 0};
  Real third = 0;
  std::int32_t degree = 0;
  for (std::size_t j = graph_.first(v); j < graph_.last(v); ++j) {
    const LocalId other = graph_.neighbours[j];
    const int part = part_of(other);
    const std::int32_t weight = graph_.edge_weights[j];
    if (part != goal.p && part != goal.q) {
      if (has_third)
        third += weight * (architecture_.inverse_link(goal.p, part) - architecture_.inverse_link(goal.q, part));
    } else if (mark_[static_cast<std::size_t>(other)] == round_) {
      const bool is_here = other < graph_.owned();
      piece.neighbours.push_back(is_here ? BandPiece::here(place_[static_cast<std::size_t>(other)])
                                         : graph_.number(other));
      piece.edge_weights.push_back(weight);
      ++degree;
    } else {
      outside[part == goal.p ? 0 : 1] += weight;
    }
  }
  piece.numbers.push_back(graph_.number(v));
  piece.weights.push_back(graph_.weights[static_cast<std::size_t>(v)]);
  piece.sides.push_back(part_of(v) == goal.p ? 0 : 1);
  piece.outside.push_back(outside);
  piece.third.push_back(third);
  piece.degrees.push_back(degree);
}

int PairRefiner::worker_of(const PairGoal& goal) const {
  return static_cast<int>(static_cast<GlobalId>(goal.p) * comm_.size() / architecture_.parts());
}

PairRefiner::PieceLists PairRefiner::send_pieces(PieceLists pieces, std::span<const PairGoal> goals) const {
  if (comm_.size() == 1) return pieces;
  std::map<int, ByteWriter> writers;
  PieceLists kept;
  for (auto& [goal, list] : pieces) {
    const int worker = worker_of(goals[static_cast<std::size_t>(goal)]);
    if (worker == comm_.rank()) {
      kept[goal] = std::move(list);
      continue;
    }
    writers[worker].put(goal);
    list.front().put(writers[worker]);
  }
  std::vector<Parcel> parcels;
  for (auto& [rank, writer] : writers) parcels.push_back({rank, writer.take()});
  for (const Parcel& parcel : sparse_exchange(comm_, std::move(parcels))) {
    ByteReader reader(parcel.bytes);
    while (!reader.at_end()) {
      const int goal = reader.get<int>();
      kept[goal].push_back(BandPiece::get(reader));
    }
  }
  return kept;
}

std::vector<PairRefiner::Answer> PairRefiner::solve(PieceLists pieces, std::span<const PairGoal> goals,
                                                    const RefinementSettings& settings) {
  std::vector<Answer> answers;
  for (auto& [g, list] : pieces) {
    const PairGoal& goal = goals[static_cast<std::size_t>(g)];
    std::vector<GlobalId> numbers;
    PairProblem problem = join_band(std::move(list), numbers);
    problem.link_cost = architecture_.inverse_link(goal.p, goal.q);
    problem.loads = {loads_[static_cast<std::size_t>(goal.p)], loads_[static_cast<std::size_t>(goal.q)]};
    problem.aims = goal.aims;
    problem.slack = goal.slack;
    const std::vector<std::uint8_t> before = problem.sides;
    if (refine_pair(problem, settings.inner_passes, settings.stall) == 0) continue;
    for (std::size_t v = 0; v < before.size(); ++v) {
      if (before[v] != problem.sides[v]) answers.push_back({numbers[v], problem.sides[v] == 0 ? goal.p : goal.q});
    }
  }
  return answers;
}

void PairRefiner::apply(const std::vector<Answer>& answers) {
  std::vector<Answer> mine = answers;
  if (comm_.size() > 1) {
    std::map<int, std::vector<Answer>> outgoing;
    for (const Answer& answer : answers) outgoing[graph_.ownership.owner_of(answer.number)].push_back(answer);
    mine.clear();
    for (const auto& [rank, list] : sparse_exchange(comm_, outgoing)) mine.insert(mine.end(), list.begin(), list.end());
  }
  for (const Answer& answer : mine) {
    const auto vertex = static_cast<LocalId>(answer.number - graph_.ownership.begin());
    parts_[static_cast<std::size_t>(vertex)] = static_cast<int>(answer.part);
    note_change(vertex);
  }
  update_copies_of_parts();
}

std::vector<GlobalId> PairRefiner::improve(std::span<const PairGoal> goals, const RefinementSettings& settings) {
  for (std::size_t g = 0; g < goals.size(); ++g) {
    goal_of_part_[static_cast<std::size_t>(goals[g].p)] = static_cast<int>(g);
    goal_of_part_[static_cast<std::size_t>(goals[g].q)] = static_cast<int>(g);
  }
  const std::vector<LocalId> band = mark_bands(goals);
  const std::vector<int> parts_before = [&] {
    std::vector<int> parts;
    for (const LocalId v : band) parts.push_back(part_of(v));
    return parts;
  }();
  apply(solve(send_pieces(cut_pieces(goals, band), goals), goals, settings));

  std::vector<Real> sums(goals.size() * 2 + 1, 0);  // weight gone from p to q, vertices changed; at the end bytes
  for (std::size_t i = 0; i < band.size(); ++i) {
    const bool is_second = parts_before[i] == goals[static_cast<std::size_t>(goal_of(band[i]))].q;
    if (is_second) sums.back() += BandPiece::bytes_of(graph_.last(band[i]) - graph_.first(band[i]));
    if (part_of(band[i]) == parts_before[i]) continue;
    if (is_second) sums.back() += sizeof(Answer);
    const auto g = static_cast<std::size_t>(goal_of(band[i]));
    const Real weight = graph_.weights[static_cast<std::size_t>(band[i])];
    sums[2 * g] += parts_before[i] == goals[g].p ? weight : -weight;
    sums[2 * g + 1] += 1;
  }
  comm_.sum_in_place(std::span<Real>(sums));
  std::vector<GlobalId> moved(goals.size());
  for (std::size_t g = 0; g < goals.size(); ++g) {
    loads_[static_cast<std::size_t>(goals[g].p)] -= sums[2 * g];
    loads_[static_cast<std::size_t>(goals[g].q)] += sums[2 * g];
    moved[g] = static_cast<GlobalId>(sums[2 * g + 1]);
    count_.moved_vertices += moved[g];
    goal_of_part_[static_cast<std::size_t>(goals[g].p)] = -1;
    goal_of_part_[static_cast<std::size_t>(goals[g].q)] = -1;
  }
  ++count_.rounds;
  count_.messages += 2 * static_cast<GlobalId>(goals.size());
  count_.bytes += static_cast<GlobalId>(sums.back());
  count_.pairs += static_cast<GlobalId>(goals.size());
  return moved;
}

PairGoal PairRefiner::balanced_goal(const QuotientEdge& edge, Real tolerance, int depth) const {
  const auto p = static_cast<std::size_t>(edge.p);
  const auto q = static_cast<std::size_t>(edge.q);
  return {edge.p, edge.q, {targets_[p], targets_[q]}, {tolerance * targets_[p], tolerance * targets_[q]}, depth};
}

void PairRefiner::smooth(Real tolerance, const RefinementSettings& settings) {
  std::vector<GlobalId> last_change(targets_.size(), 0);
  std::map<std::pair<int, int>, GlobalId> last_run;
  GlobalId now = 1;
  for (int pass = 0; pass < settings.passes; ++pass) {
    std::vector<QuotientEdge> edges = quotient();
    std::erase_if(edges, [&](const QuotientEdge& edge) {
      const auto run = last_run.find({edge.p, edge.q});
      return run != last_run.end() && last_change[static_cast<std::size_t>(edge.p)] < run->second &&
             last_change[static_cast<std::size_t>(edge.q)] < run->second;
    });
    std::stable_sort(edges.begin(), edges.end(),
                     [](const QuotientEdge& a, const QuotientEdge& b) { return a.weight > b.weight; });
    std::vector<std::pair<int, int>> pairs;
    for (const QuotientEdge& edge : edges) pairs.emplace_back(edge.p, edge.q);
    GlobalId moved = 0;
    for (const std::vector<std::size_t>& round : disjoint_rounds(pairs, architecture_.parts())) {
      std::vector<PairGoal> goals;
      for (const std::size_t i : round) goals.push_back(balanced_goal(edges[i], tolerance, settings.depth));
      const std::vector<GlobalId> changes = improve(goals, settings);
      ++now;
      for (std::size_t g = 0; g < goals.size(); ++g) {
        last_run[{goals[g].p, goals[g].q}] = now;
        if (changes[g] == 0) continue;
        moved += changes[g];
        last_change[static_cast<std::size_t>(goals[g].p)] = now;
        last_change[static_cast<std::size_t>(goals[g].q)] = now;
      }
    }
    if (moved == 0) break;
  }
}

GlobalId PairRefiner::absorb_pieces() {
  const std::vector<int> before = parts_;
  const GlobalId absorbed = absorb_stray_pieces(comm_, graph_, parts_, loads_, targets_);
  for (LocalId v = 0; v < graph_.vertices(); ++v) {
    if (before[static_cast<std::size_t>(v)] != part_of(v)) note_change(v);
  }
  return absorbed;
}

bool PairRefiner::tidy(Real tolerance) {
  const std::vector<int> before = parts_;
  const Real allowed = std::max(1.05 * tolerance, imbalance());
  if (absorb_pieces() == 0) return false;
  diffuse(tolerance, 4);
  if (imbalance() <= allowed) return true;
  start(before);
  return false;
}

std::vector<std::vector<std::size_t>> disjoint_rounds(std::span<const std::pair<int, int>> pairs, int n_parts) {
  std::vector<std::vector<std::size_t>> rounds;
  std::vector<std::size_t> left(pairs.size());
  std::iota(left.begin(), left.end(), std::size_t{0});
  std::vector<char> is_taken(static_cast<std::size_t>(n_parts));
  while (!left.empty()) {
    std::fill(is_taken.begin(), is_taken.end(), 0);
    std::vector<std::size_t> later;
    std::vector<std::size_t>& round = rounds.emplace_back();
    for (const std::size_t i : left) {
      char& p = is_taken[static_cast<std::size_t>(pairs[i].first)];
      char& q = is_taken[static_cast<std::size_t>(pairs[i].second)];
      if (p != 0 || q != 0) {
        later.push_back(i);
      } else {
        p = q = 1;
        round.push_back(i);
      }
    }
    left = std::move(later);
  }
  return rounds;
}

}  // namespace malleus
