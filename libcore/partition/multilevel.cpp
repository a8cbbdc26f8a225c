#include "partition/multilevel.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "base/error.hpp"
#include "parallel/gather.hpp"
#include "partition/coarsen.hpp"
#include "partition/kway_refiner.hpp"
#include "partition/partition_cost.hpp"
#include "partition/replicate.hpp"

namespace malleus {
namespace {

/// A graph of at most this many vertices, and so many a part, is refined by each rank for itself, all alike: rounds of
/// pairs on small graphs are waiting more than work.
constexpr GlobalId few_vertices = 20000;
/// Of the bands: a third step from the border costs half as much time again and gains nothing that shows.
constexpr int band_depth = 2;
constexpr int search_stall = 60;  ///< in the bands
constexpr int kway_rounds = 3;
constexpr int kway_patience = 25;
constexpr std::size_t most_levels = 30;
/// Vertices at which coarsening ends where the parts are few.
constexpr GlobalId least_vertices = 2000;
/// Starts that are refined beyond the coarsest graph, whose cuts tell only roughly which is the best.
constexpr std::size_t carried_starts = 2;
constexpr Real least_shrinking = 0.95;

std::vector<int> owned_parts(const WorkGraph& graph, std::vector<int> parts) {
  parts.resize(static_cast<std::size_t>(graph.owned()));
  return parts;
}

std::vector<int> with_copies(const WorkGraph& graph, std::vector<int> parts) {
  parts.resize(static_cast<std::size_t>(graph.vertices()));
  graph.halo.update_copies(std::span<std::int32_t>(parts), 1);
  return parts;
}

Real heaviest_vertex(const Communicator& comm, const WorkGraph& graph) {
  Real heaviest = 0;
  for (const Real w : graph.weights) heaviest = std::max(heaviest, w);
  return comm.max(heaviest);
}

/// Graphs from the given one to the coarsest, and back.
class Multilevel {
 public:
  Multilevel(const Communicator& comm, const Architecture& architecture, const std::vector<Real>& targets,
             const MultilevelSettings& settings, RefinementCount& count)
      : comm_(comm), architecture_(architecture), targets_(targets), settings_(settings), count_(count) {
    few_ = few_vertices + settings.vertices_per_part * static_cast<GlobalId>(targets.size());
  }

  std::vector<int> refine(const WorkGraph& finest, std::vector<int> parts) const {
    if (is_copied_to_all(finest)) return refine_copied(finest, parts, settings_);
    const std::vector<CoarseGraph> levels = make_levels(finest, parts, comm_.size() > 1 ? few_ : fewest());
    parts = on_coarsest(levels, std::move(parts));
    if (!levels.empty()) {
      const WorkGraph& graph = levels.back().graph;
      parts = is_copied_to_all(graph) ? refine_copied(graph, parts, settings_on(graph))
                                      : refine_coarse(graph, std::move(parts), settings_on(graph).tolerance, true);
    }
    return climb(finest, levels, std::move(parts));
  }

  Divided divide(const WorkGraph& finest, std::span<const StartMaker> starts) const {
    if (is_copied_to_all(finest)) return divide_copied(finest, starts, settings_);
    const std::vector<CoarseGraph> levels = make_levels(finest, {}, few_);
    const WorkGraph& graph = levels.empty() ? finest : levels.back().graph;
    Divided divided =
        is_copied_to_all(graph) ? divide_copied(graph, starts, settings_on(graph)) : divide_few(graph, starts);
    divided.parts = climb(finest, levels, std::move(divided.parts));
    return divided;
  }

 private:
  static constexpr int most_flow_rounds = 30;
  static constexpr int few_flow_rounds = 6;

  bool is_copied_to_all(const WorkGraph& graph) const { return comm_.size() > 1 && graph.ownership.total() <= few_; }

  /// Whether every rank holds the graph, as it would on a machine with a rank a part.
  bool is_for_one_rank(const WorkGraph& graph) const { return comm_.size() == 1 && graph.ownership.total() <= few_; }

  MultilevelSettings settings_on(const WorkGraph& graph) const {
    const Real smallest = *std::min_element(targets_.begin(), targets_.end());
    const Real grain = smallest > 0 ? heaviest_vertex(comm_, graph) / smallest : 0;
    MultilevelSettings here = settings_;
    here.tolerance = std::clamp(1.5 * grain, settings_.tolerance, std::max(settings_.tolerance, 0.03));
    return here;
  }

  /// Starts by places are made on this graph, and vertices merged that lie together in all of them, so that the
  /// coarsest graph holds each as it was made; there those that cut least are chosen.
  Divided divide_few(const WorkGraph& graph, std::span<const StartMaker> makers) const {
    std::vector<std::vector<int>> starts;
    for (const StartMaker& maker : makers) {
      if (!maker.is_for_coarsest) starts.push_back(maker.make(comm_, graph));
    }
    const std::vector<CoarseGraph> levels = make_levels(graph, common_pieces(starts), fewest());
    const WorkGraph& coarsest = levels.empty() ? graph : levels.back().graph;
    const Real tolerance = settings_on(coarsest).tolerance;
    auto made = starts.begin();
    std::vector<Divided> tried;
    for (std::size_t i = 0; i < makers.size(); ++i) {
      std::vector<int> start =
          makers[i].is_for_coarsest ? makers[i].make(comm_, coarsest) : on_coarsest(levels, std::move(*made++));
      tried.push_back({refine_coarse(coarsest, std::move(start), tolerance, true), i});
    }
    keep_best(coarsest, tried, carried_starts);
    for (Divided& divided : tried) divided.parts = climb(graph, levels, std::move(divided.parts));
    keep_best(graph, tried, 1);
    return std::move(tried.front());
  }

  /// The so many that cut least, in that order.
  void keep_best(const WorkGraph& graph, std::vector<Divided>& tried, std::size_t wanted) const {
    std::vector<std::pair<Real, std::size_t>> cuts;
    for (std::size_t i = 0; i < tried.size(); ++i) cuts.emplace_back(linked_cut(graph, tried[i].parts), i);
    std::sort(cuts.begin(), cuts.end());
    std::vector<Divided> kept;
    for (std::size_t i = 0; i < std::min(wanted, cuts.size()); ++i) kept.push_back(std::move(tried[cuts[i].second]));
    tried = std::move(kept);
  }

  /// [vertex] a number that is the same for two vertices where they lie in one part in all of the partitions.
  static std::vector<int> common_pieces(std::span<const std::vector<int>> partitions) {
    if (partitions.empty()) return {};
    std::vector<int> pieces = partitions.front();
    for (const std::vector<int>& parts : partitions.subspan(1)) {
      std::map<std::pair<int, int>, int> numbers;
      for (std::size_t v = 0; v < pieces.size(); ++v)
        pieces[v] = numbers.try_emplace({pieces[v], parts[v]}, static_cast<int>(numbers.size())).first->second;
    }
    return pieces;
  }

  /// Edges between parts, divided by the bandwidths of their links.
  Real linked_cut(const WorkGraph& graph, std::vector<int> parts) const {
    parts = with_copies(graph, std::move(parts));
    Real cut = 0;
    for (LocalId v = 0; v < graph.owned(); ++v) {
      const int part = parts[static_cast<std::size_t>(v)];
      for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
        const int other = parts[static_cast<std::size_t>(graph.neighbours[j])];
        if (other != part) cut += graph.edge_weights[j] * architecture_.inverse_link(part, other);
      }
    }
    return comm_.sum(cut);
  }

  std::vector<int> climb(const WorkGraph& finest, const std::vector<CoarseGraph>& levels,
                         std::vector<int> parts) const {
    for (std::size_t level = levels.size(); level > 0; --level) {
      const WorkGraph& graph = levels[level - 1].graph;
      if (level < levels.size()) parts = refine_coarse(graph, std::move(parts), settings_on(graph).tolerance, false);
      const std::vector<LocalId>& coarse_of = levels[level - 1].coarse_of;
      std::vector<int> finer(coarse_of.size());
      for (std::size_t v = 0; v < finer.size(); ++v) finer[v] = parts[static_cast<std::size_t>(coarse_of[v])];
      parts = std::move(finer);
    }
    return refine_finest(finest, std::move(parts), levels.empty() ? most_flow_rounds : few_flow_rounds);
  }

  GlobalId fewest() const {
    return std::max(least_vertices, settings_.vertices_per_part * static_cast<GlobalId>(targets_.size()));
  }

  /// Ever coarser graphs, down to so many vertices; vertices of different pieces stay apart, where any are given.
  std::vector<CoarseGraph> make_levels(const WorkGraph& finest, std::vector<int> pieces, GlobalId enough) const {
    const Real total = std::accumulate(targets_.begin(), targets_.end(), Real{0});
    const Real heaviest = std::max(1.0, total / (1.5 * static_cast<Real>(fewest())));
    const bool has_pieces = comm_.any(!pieces.empty());
    std::vector<CoarseGraph> levels;
    levels.reserve(most_levels);  // references to the graphs stay valid
    const WorkGraph* graph = &finest;
    while (levels.size() < most_levels && graph->ownership.total() > enough) {
      if (has_pieces) pieces = with_copies(*graph, std::move(pieces));
      CoarseGraph coarse = coarsen(comm_, *graph, pieces, heaviest);
      const auto shrunk = static_cast<Real>(coarse.graph.ownership.total());
      if (shrunk > least_shrinking * static_cast<Real>(graph->ownership.total())) break;
      if (has_pieces) pieces = coarse_parts(coarse, pieces);
      levels.push_back(std::move(coarse));
      graph = &levels.back().graph;
    }
    return levels;
  }

  static std::vector<int> on_coarsest(std::span<const CoarseGraph> levels, std::vector<int> parts) {
    for (const CoarseGraph& level : levels) parts = coarse_parts(level, parts);
    return parts;
  }

  static std::vector<int> coarse_parts(const CoarseGraph& coarse, std::span<const int> parts) {
    std::vector<int> result(coarse.graph.weights.size());
    for (std::size_t v = 0; v < coarse.coarse_of.size(); ++v) {
      result[static_cast<std::size_t>(coarse.coarse_of[v])] = parts[v];
    }
    return result;
  }

  /// Levels the loads where they want it, then improves the borders.
  std::vector<int> refine_coarse(const WorkGraph& graph, std::vector<int> parts, Real tolerance,
                                 bool is_coarsest) const {
    std::vector<Real> loads = part_loads(comm_, graph, parts, architecture_.parts());
    if (is_coarsest || imbalance_of(loads) > tolerance || !is_for_one_rank(graph)) {
      PairRefiner refiner(comm_, graph, architecture_, with_copies(graph, std::move(parts)), targets_);
      if (is_coarsest || refiner.imbalance() > tolerance) {
        refiner.diffuse(0.6 * tolerance, is_coarsest ? most_flow_rounds : few_flow_rounds);
        refiner.tidy(0.6 * tolerance);
      }
      if (!is_for_one_rank(graph))
        refiner.smooth(tolerance, {settings_.passes, band_depth, settings_.passes, search_stall});
      count_.add(refiner.count());
      loads = refiner.loads();
      parts = owned_parts(graph, std::move(refiner).take_parts());
    }
    if (is_for_one_rank(graph))
      refine_kway(graph, architecture_, parts, loads, targets_, {tolerance, kway_rounds, kway_patience});
    return parts;
  }

  Real imbalance_of(std::span<const Real> loads) const {
    Real worst = 0;
    for (std::size_t p = 0; p < loads.size(); ++p) {
      if (targets_[p] > 0) worst = std::max(worst, loads[p] / targets_[p] - 1);
    }
    return worst;
  }

  std::vector<int> refine_finest(const WorkGraph& graph, std::vector<int> parts, int flow_rounds) const {
    PairRefiner refiner(comm_, graph, architecture_, with_copies(graph, std::move(parts)), targets_);
    refiner.diffuse(0.9 * settings_.tolerance, flow_rounds);
    refiner.smooth(settings_.tolerance, {settings_.passes, band_depth, settings_.passes, search_stall});
    for (int sweep = 0; sweep < 3 && refiner.tidy(settings_.tolerance); ++sweep) {
      refiner.smooth(settings_.tolerance, {1, band_depth, 1, 100});
    }
    count_.add(refiner.count());
    return owned_parts(graph, std::move(refiner).take_parts());
  }

  /// The same on every rank by itself, for graphs of few vertices.
  std::vector<int> refine_copied(const WorkGraph& graph, const std::vector<int>& parts,
                                 const MultilevelSettings& settings) const {
    const Communicator alone(MPI_COMM_SELF);
    const WorkGraph whole = replicate_graph(comm_, alone, graph);
    const Multilevel multilevel(alone, architecture_, targets_, settings, count_);
    return own(graph, multilevel.refine(whole, gather_lists<int>(comm_, parts)));
  }

  Divided divide_copied(const WorkGraph& graph, std::span<const StartMaker> starts,
                        const MultilevelSettings& settings) const {
    const Communicator alone(MPI_COMM_SELF);
    const WorkGraph whole = replicate_graph(comm_, alone, graph);
    Divided divided = Multilevel(alone, architecture_, targets_, settings, count_).divide(whole, starts);
    divided.parts = own(graph, divided.parts);
    return divided;
  }

  static std::vector<int> own(const WorkGraph& graph, const std::vector<int>& parts) {
    const auto first = parts.begin() + graph.ownership.begin();
    return {first, first + graph.owned()};
  }

  const Communicator& comm_;
  const Architecture& architecture_;
  const std::vector<Real>& targets_;
  const MultilevelSettings& settings_;
  RefinementCount& count_;
  GlobalId few_;  ///< vertices up to which a graph is copied to all ranks
};

}  // namespace

std::vector<int> refine_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                   std::vector<int> parts, const std::vector<Real>& targets,
                                   const MultilevelSettings& settings, RefinementCount& count) {
  return Multilevel(comm, architecture, targets, settings, count).refine(graph, std::move(parts));
}

Divided divide_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                          std::span<const StartMaker> starts, const std::vector<Real>& targets,
                          const MultilevelSettings& settings, RefinementCount& count) {
  check(!starts.empty(), "there is a start");
  return Multilevel(comm, architecture, targets, settings, count).divide(graph, starts);
}

}  // namespace malleus
