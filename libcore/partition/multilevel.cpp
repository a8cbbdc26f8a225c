#include "partition/multilevel.hpp"

#include <algorithm>
#include <numeric>

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

std::vector<int> with_copies(const WorkGraph& graph, std::vector<int> parts) {
  parts.resize(static_cast<std::size_t>(graph.vertices()));
  graph.halo.update_copies(std::span<std::int32_t>(parts), 1);
  return parts;
}

/// Coarser graphs of the given one, to about `enough` vertices; parts become those of the coarsest's owned vertices.
std::vector<CoarseGraph> make_levels(const Communicator& comm, const WorkGraph& finest, std::vector<int>& parts,
                                     const std::vector<Real>& targets, GlobalId enough,
                                     const MultilevelSettings& settings) {
  const Real total = std::accumulate(targets.begin(), targets.end(), Real{0});
  const auto n_parts = static_cast<GlobalId>(targets.size());
  const Real heaviest = std::max(1.0, total / (1.5 * settings.vertices_per_part * static_cast<Real>(n_parts)));
  std::vector<CoarseGraph> levels;
  const WorkGraph* graph = &finest;
  levels.reserve(most_levels);
  while (levels.size() < most_levels && graph->ownership.total() > enough) {
    CoarseGraph coarse = coarsen(comm, *graph, with_copies(*graph, parts), heaviest);
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

Real heaviest_vertex(const Communicator& comm, const WorkGraph& graph) {
  Real heaviest = 0;
  for (const Real w : graph.weights) heaviest = std::max(heaviest, w);
  return comm.max(heaviest);
}

/// Improves one level.
std::vector<int> refine_level(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                              std::vector<int> parts, const std::vector<Real>& targets, Real tolerance,
                              bool is_coarsest, const RefinementSettings& settings) {
  PairRefiner refiner(comm, graph, architecture, with_copies(graph, std::move(parts)), targets);
  if (is_coarsest || refiner.imbalance() > tolerance) {
    refiner.diffuse(0.6 * tolerance, is_coarsest ? 30 : 6);
    refiner.tidy(0.6 * tolerance);
  }
  refiner.smooth(tolerance, settings);
  parts = std::move(refiner).take_parts();
  parts.resize(static_cast<std::size_t>(graph.owned()));
  return parts;
}

/// The same on every rank by itself, for graphs of few vertices.
std::vector<int> refine_replicated(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                   const std::vector<int>& parts, const std::vector<Real>& targets,
                                   const MultilevelSettings& settings) {
  const Communicator alone(MPI_COMM_SELF);
  const WorkGraph whole = replicate_graph(comm, alone, graph);
  const std::vector<int> refined =
      refine_multilevel(alone, whole, architecture, gather_lists<int>(comm, parts), targets, settings);
  const auto first = refined.begin() + graph.ownership.begin();
  return {first, first + graph.owned()};
}

std::vector<int> refine_finest(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                               std::vector<int> parts, const std::vector<Real>& targets, int rounds,
                               const MultilevelSettings& settings) {
  PairRefiner refiner(comm, graph, architecture, with_copies(graph, std::move(parts)), targets);
  refiner.diffuse(0.9 * settings.tolerance, rounds);
  refiner.smooth(settings.tolerance, {settings.fine_passes, band_depth, 2, 300});
  for (int sweep = 0; sweep < 3 && refiner.tidy(settings.tolerance); ++sweep) {
    refiner.smooth(settings.tolerance, {1, band_depth, 1, 100});
  }
  parts = std::move(refiner).take_parts();
  parts.resize(static_cast<std::size_t>(graph.owned()));
  return parts;
}

}  // namespace

std::vector<int> refine_multilevel(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                                   std::vector<int> parts, const std::vector<Real>& targets,
                                   const MultilevelSettings& settings) {
  const GlobalId few = few_vertices + settings.vertices_per_part * static_cast<GlobalId>(targets.size());
  if (comm.size() > 1 && graph.ownership.total() <= few) {
    return refine_replicated(comm, graph, architecture, parts, targets, settings);
  }
  const GlobalId enough = comm.size() > 1 ? few : settings.vertices_per_part * static_cast<GlobalId>(targets.size());
  const std::vector<CoarseGraph> levels = make_levels(comm, graph, parts, targets, enough, settings);
  const Real smallest = *std::min_element(targets.begin(), targets.end());
  for (std::size_t level = levels.size(); level > 0; --level) {
    const WorkGraph& coarse = levels[level - 1].graph;
    const bool is_coarsest = level == levels.size();
    const Real grain = smallest > 0 ? heaviest_vertex(comm, coarse) / smallest : 0;
    MultilevelSettings here = settings;
    here.tolerance = std::clamp(1.5 * grain, settings.tolerance, std::max(settings.tolerance, 0.03));
    if (is_coarsest && comm.size() > 1 && coarse.ownership.total() <= few) {
      parts = refine_replicated(comm, coarse, architecture, parts, targets, here);
    } else {
      parts = refine_level(comm, coarse, architecture, std::move(parts), targets, here.tolerance, is_coarsest,
                           {settings.coarse_passes, band_depth, 2, 200});
    }
    const std::vector<LocalId>& coarse_of = levels[level - 1].coarse_of;
    std::vector<int> finer(coarse_of.size());
    for (std::size_t v = 0; v < finer.size(); ++v) finer[v] = parts[static_cast<std::size_t>(coarse_of[v])];
    parts = std::move(finer);
  }
  return refine_finest(comm, graph, architecture, std::move(parts), targets, levels.empty() ? 30 : 6, settings);
}

}  // namespace malleus
