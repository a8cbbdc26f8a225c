#include "partition/multilevel.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "parallel/gather.hpp"
#include "partition/coarsen.hpp"
#include "partition/replicate.hpp"

namespace malleus {
namespace {

/// A graph of at most this many vertices, and so many a part, is refined by each rank for itself, all alike: rounds of
/// pairs on small graphs are waiting more than work.
constexpr GlobalId few_vertices = 60000;
/// Of the bands: a third step from the border costs half as much time again and gains nothing that shows.
constexpr int band_depth = 2;
constexpr std::size_t most_levels = 30;
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

  /// The starts are tried down to the coarsest graph; the one that cuts least there is refined on all levels.
  std::vector<int> refine(const WorkGraph& finest, std::vector<std::vector<int>> starts, std::size_t& chosen) const {
    Descent best;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      Descent descent = descend(finest, std::move(starts[i]), starts.size() > 1);
      if (i > 0 && descent.cut >= best.cut) continue;
      best = std::move(descent);
      chosen = i;
    }
    return best.levels.empty() && is_copied_to_all(finest) ? best.parts : climb(finest, std::move(best));
  }

 private:
  static constexpr int most_flow_rounds = 30;
  static constexpr int few_flow_rounds = 6;

  /// Graphs from the finest down, and parts that were refined on the coarsest.
  struct Descent {
    std::vector<CoarseGraph> levels;
    std::vector<int> parts;
    Real cut = 0;  ///< of the parts, only where it is asked for
  };

  bool is_copied_to_all(const WorkGraph& graph) const { return comm_.size() > 1 && graph.ownership.total() <= few_; }

  MultilevelSettings settings_on(const WorkGraph& graph) const {
    const Real smallest = *std::min_element(targets_.begin(), targets_.end());
    const Real grain = smallest > 0 ? heaviest_vertex(comm_, graph) / smallest : 0;
    MultilevelSettings here = settings_;
    here.tolerance = std::clamp(1.5 * grain, settings_.tolerance, std::max(settings_.tolerance, 0.03));
    return here;
  }

  Descent descend(const WorkGraph& finest, std::vector<int> parts, bool wants_cut) const {
    Descent descent;
    if (is_copied_to_all(finest)) {
      descent.parts = refine_copied(finest, parts, settings_);
    } else {
      descent.levels = make_levels(finest, parts);
      if (!descent.levels.empty()) {
        const WorkGraph& graph = descent.levels.back().graph;
        const MultilevelSettings here = settings_on(graph);
        parts = is_copied_to_all(graph) ? refine_copied(graph, parts, here)
                                        : refine_coarse(graph, std::move(parts), here.tolerance, true);
      }
      descent.parts = std::move(parts);
    }
    if (wants_cut) descent.cut = linked_cut(comm_, coarsest(finest, descent), architecture_, descent.parts);
    return descent;
  }

  static const WorkGraph& coarsest(const WorkGraph& finest, const Descent& descent) {
    return descent.levels.empty() ? finest : descent.levels.back().graph;
  }

  std::vector<int> climb(const WorkGraph& finest, Descent descent) const {
    std::vector<int> parts = std::move(descent.parts);
    for (std::size_t level = descent.levels.size(); level > 0; --level) {
      const WorkGraph& graph = descent.levels[level - 1].graph;
      if (level < descent.levels.size())
        parts = refine_coarse(graph, std::move(parts), settings_on(graph).tolerance, false);
      const std::vector<LocalId>& coarse_of = descent.levels[level - 1].coarse_of;
      std::vector<int> finer(coarse_of.size());
      for (std::size_t v = 0; v < finer.size(); ++v) finer[v] = parts[static_cast<std::size_t>(coarse_of[v])];
      parts = std::move(finer);
    }
    return refine_finest(finest, std::move(parts), descent.levels.empty() ? most_flow_rounds : few_flow_rounds);
  }

  /// Ever coarser graphs; parts become those of the coarsest's owned vertices.
  std::vector<CoarseGraph> make_levels(const WorkGraph& finest, std::vector<int>& parts) const {
    const Real total = std::accumulate(targets_.begin(), targets_.end(), Real{0});
    const auto n_parts = static_cast<GlobalId>(targets_.size());
    const GlobalId enough = comm_.size() > 1 ? few_ : settings_.vertices_per_part * n_parts;
    const Real heaviest = std::max(1.0, total / (1.5 * settings_.vertices_per_part * static_cast<Real>(n_parts)));
    std::vector<CoarseGraph> levels;
    levels.reserve(most_levels);  // references to the graphs stay valid
    const WorkGraph* graph = &finest;
    while (levels.size() < most_levels && graph->ownership.total() > enough) {
      CoarseGraph coarse = coarsen(comm_, *graph, with_copies(*graph, parts), heaviest);
      const auto shrunk = static_cast<Real>(coarse.graph.ownership.total());
      if (shrunk > least_shrinking * static_cast<Real>(graph->ownership.total())) break;
      std::vector<int> coarse_parts(coarse.graph.weights.size());
      for (std::size_t v = 0; v < coarse.coarse_of.size(); ++v) {
        coarse_parts[static_cast<std::size_t>(coarse.coarse_of[v])] = parts[v];
      }
      parts = std::move(coarse_parts);
      levels.push_back(std::move(coarse));
      graph = &levels.back().graph;
    }
    return levels;
  }

  std::vector<int> refine_coarse(const WorkGraph& graph, std::vector<int> parts, Real tolerance,
                                 bool is_coarsest) const {
    PairRefiner refiner(comm_, graph, architecture_, with_copies(graph, std::move(parts)), targets_);
    if (is_coarsest || refiner.imbalance() > tolerance) {
      refiner.diffuse(0.6 * tolerance, is_coarsest ? most_flow_rounds : few_flow_rounds);
      refiner.tidy(0.6 * tolerance);
    }
    refiner.smooth(tolerance, {settings_.coarse_passes, band_depth, 2, 200});
    count_.add(refiner.count());
    return owned_parts(graph, std::move(refiner).take_parts());
  }

  std::vector<int> refine_finest(const WorkGraph& graph, std::vector<int> parts, int flow_rounds) const {
    PairRefiner refiner(comm_, graph, architecture_, with_copies(graph, std::move(parts)), targets_);
    refiner.diffuse(0.9 * settings_.tolerance, flow_rounds);
    refiner.smooth(settings_.tolerance, {settings_.fine_passes, band_depth, 2, 300});
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
    const std::vector<int> refined =
        refine_multilevel(alone, whole, architecture_, {gather_lists<int>(comm_, parts)}, targets_, settings, count_)
            .parts;
    const auto first = refined.begin() + graph.ownership.begin();
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

Refined refine_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                          std::vector<std::vector<int>> starts, const std::vector<Real>& targets,
                          const MultilevelSettings& settings, RefinementCount& count) {
  check(!starts.empty(), "there is a start");
  Refined refined;
  refined.parts =
      Multilevel(comm, architecture, targets, settings, count).refine(graph, std::move(starts), refined.start);
  return refined;
}

Real linked_cut(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                std::vector<int> parts) {
  parts = with_copies(graph, std::move(parts));
  Real cut = 0;
  for (LocalId v = 0; v < graph.owned(); ++v) {
    const int part = parts[static_cast<std::size_t>(v)];
    for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
      const int other = parts[static_cast<std::size_t>(graph.neighbours[j])];
      if (other != part) cut += graph.edge_weights[j] * architecture.inverse_link(part, other);
    }
  }
  return comm.sum(cut);
}

}  // namespace malleus
