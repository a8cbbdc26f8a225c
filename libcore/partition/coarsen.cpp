#include "partition/coarsen.hpp"

#include <algorithm>

namespace malleus {
namespace {

/// Coarse vertex of each owned vertex; sets how many there are.
std::vector<LocalId> match(const WorkGraph& graph, std::span<const int> parts, Real heaviest, LocalId& count) {
  std::vector<LocalId> coarse_of(graph.weights.size(), -1);
  count = 0;
  for (LocalId v = 0; v < graph.owned(); ++v) {
    const auto i = static_cast<std::size_t>(v);
    if (coarse_of[i] >= 0) continue;
    LocalId best = -1;
    std::int32_t strongest = 0;
    for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
      const LocalId other = graph.neighbours[j];
      const auto o = static_cast<std::size_t>(other);
      if (other >= graph.owned() || other == v || coarse_of[o] >= 0) continue;
      if (!parts.empty() && parts[o] != parts[i]) continue;
      if (graph.weights[i] + graph.weights[o] > heaviest) continue;
      const bool is_better =
          graph.edge_weights[j] > strongest ||
          (graph.edge_weights[j] == strongest && graph.weights[o] < graph.weights[static_cast<std::size_t>(best)]);
      if (!is_better) continue;
      best = other;
      strongest = graph.edge_weights[j];
    }
    coarse_of[i] = count;
    if (best >= 0) coarse_of[static_cast<std::size_t>(best)] = count;
    ++count;
  }
  return coarse_of;
}

void merge_vertices(const WorkGraph& fine, std::span<const LocalId> coarse_of, LocalId count, WorkGraph& coarse) {
  const auto dim = static_cast<std::size_t>(fine.dim);
  coarse.weights.assign(static_cast<std::size_t>(count), 0);
  coarse.centres.assign(static_cast<std::size_t>(count) * dim, 0);
  std::vector<Real> shares(static_cast<std::size_t>(count), 0);
  for (std::size_t v = 0; v < coarse_of.size(); ++v) {
    const auto c = static_cast<std::size_t>(coarse_of[v]);
    const Real share = std::max(1.0, fine.weights[v]);
    coarse.weights[c] += fine.weights[v];
    shares[c] += share;
    for (std::size_t a = 0; a < dim; ++a) coarse.centres[c * dim + a] += share * fine.centres[v * dim + a];
  }
  for (std::size_t c = 0; c < shares.size(); ++c) {
    for (std::size_t a = 0; a < dim; ++a) coarse.centres[c * dim + a] /= shares[c];
  }
}

/// Fine vertices by coarse ones, in two steps: start [coarse + 1] and list.
struct Members {
  std::vector<LocalId> start;
  std::vector<LocalId> list;
};

Members sort_members(std::span<const LocalId> coarse_of, LocalId count) {
  Members members;
  members.start.assign(static_cast<std::size_t>(count) + 1, 0);
  for (const LocalId c : coarse_of) ++members.start[static_cast<std::size_t>(c) + 1];
  for (std::size_t c = 0; c < static_cast<std::size_t>(count); ++c) members.start[c + 1] += members.start[c];
  members.list.resize(coarse_of.size());
  std::vector<LocalId> next(members.start.begin(), members.start.end() - 1);
  for (std::size_t v = 0; v < coarse_of.size(); ++v) {
    members.list[static_cast<std::size_t>(next[static_cast<std::size_t>(coarse_of[v])]++)] = static_cast<LocalId>(v);
  }
  return members;
}

/// Edges between coarse vertices; all_coarse: of each fine vertex, copies included, the local coarse vertex.
void merge_edges(const WorkGraph& fine, const Members& members, std::span<const LocalId> all_coarse,
                 WorkGraph& coarse) {
  std::vector<std::int64_t> place(static_cast<std::size_t>(coarse.vertices()), -1);
  coarse.start.assign(1, 0);
  std::int64_t first_edge = 0;  // of the coarse vertex at hand
  const auto add = [&](LocalId other, std::int32_t weight) {
    std::int64_t& known = place[static_cast<std::size_t>(other)];
    if (known < first_edge) {
      known = static_cast<std::int64_t>(coarse.neighbours.size());
      coarse.neighbours.push_back(other);
      coarse.edge_weights.push_back(0);
    }
    coarse.edge_weights[static_cast<std::size_t>(known)] += weight;
  };
  for (LocalId c = 0; c < coarse.owned(); ++c) {
    first_edge = static_cast<std::int64_t>(coarse.neighbours.size());
    for (LocalId m = members.start[static_cast<std::size_t>(c)]; m < members.start[static_cast<std::size_t>(c) + 1];
         ++m) {
      const LocalId v = members.list[static_cast<std::size_t>(m)];
      for (std::size_t j = fine.first(v); j < fine.last(v); ++j) {
        const LocalId other = all_coarse[static_cast<std::size_t>(fine.neighbours[j])];
        if (other != c) add(other, fine.edge_weights[j]);
      }
    }
    coarse.start.push_back(static_cast<std::int64_t>(coarse.neighbours.size()));
  }
}

}  // namespace

CoarseGraph coarsen(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts, Real heaviest) {
  CoarseGraph result;
  LocalId count = 0;
  result.coarse_of = match(graph, parts, heaviest, count);
  WorkGraph& coarse = result.graph;
  coarse.dim = graph.dim;
  coarse.unit = graph.unit;
  coarse.ownership = Ownership(comm, count);
  merge_vertices(graph, result.coarse_of, count, coarse);

  std::vector<GlobalId> numbers(static_cast<std::size_t>(graph.vertices()), -1);
  for (std::size_t v = 0; v < result.coarse_of.size(); ++v) {
    numbers[v] = coarse.ownership.begin() + result.coarse_of[v];
  }
  graph.halo.update_copies(std::span<GlobalId>(numbers), 1);
  coarse.copy_numbers.assign(numbers.begin() + graph.owned(), numbers.end());
  std::sort(coarse.copy_numbers.begin(), coarse.copy_numbers.end());
  coarse.copy_numbers.erase(std::unique(coarse.copy_numbers.begin(), coarse.copy_numbers.end()),
                            coarse.copy_numbers.end());
  coarse.halo = Halo(comm, coarse.ownership, coarse.copy_numbers);

  std::vector<LocalId> all_coarse(result.coarse_of);
  for (std::size_t v = all_coarse.size(); v < numbers.size(); ++v) {
    const auto place = std::lower_bound(coarse.copy_numbers.begin(), coarse.copy_numbers.end(), numbers[v]);
    all_coarse.push_back(count + static_cast<LocalId>(place - coarse.copy_numbers.begin()));
  }
  merge_edges(graph, sort_members(result.coarse_of, count), all_coarse, coarse);
  return result;
}

}  // namespace malleus
