#include "remesh/remesher.hpp"

#include <algorithm>
#include <ctime>
#include <limits>

#include "remesh/untangle.hpp"

namespace malleus::remeshing {
namespace {

Real processor_seconds() {
  return static_cast<Real>(std::clock()) / CLOCKS_PER_SEC;
}

template <int D, class Metric>
struct EdgeExtremes {
  Real longest = -1, shortest = 1e300;
  std::size_t longest_edge = 0, shortest_edge = 0;

  EdgeExtremes(const WorkingMesh<D, Metric>& mesh, const Element<D>& element) {
    for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
      const auto [a, b] = EdgeTable<D>::nodes[edge];
      const Real length = mesh.sizing_of(element.node[a], element.node[b]);
      if (length > longest) {
        longest = length;
        longest_edge = edge;
      }
      if (length < shortest) {
        shortest = length;
        shortest_edge = edge;
      }
    }
  }
};

}  // namespace

template <int D, class Metric>
void Remesher<D, Metric>::timed(const char* phase, const std::function<void()>& work) {
  const Real start = processor_seconds();
  work();
  const Real seconds = processor_seconds() - start;
  for (auto& known : phases_) {
    if (known.name == phase) {
      known.processor_s += seconds;
      return;
    }
  }
  phases_.push_back({phase, 0, seconds});
}

template <int D, class Metric>
void Remesher<D, Metric>::enlist_all() {
  for (std::size_t e = 0; e < mesh_.elements.size(); ++e) {
    if (mesh_.elements[e].is_live()) operators_.enlist(static_cast<LocalId>(e), pending::swap | pending::length);
  }
  for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
    if (mesh_.vertices[v].element >= 0) operators_.enlist_vertex(static_cast<LocalId>(v));
  }
}

/// Renumbering pays once much of the mesh is out of order.
template <int D, class Metric>
void Remesher<D, Metric>::renumber_if_grown() {
  const LocalId now = mesh_.count_elements();
  if (now > 1.5 * ordered_elements_ || 1.5 * now < ordered_elements_) timed("renumber", [&] { renumber_all(); });
}

/// Renumbers, and makes the lists anew in the new order.
template <int D, class Metric>
void Remesher<D, Metric>::renumber_all() {
  renumber(mesh_);
  ordered_elements_ = mesh_.count_elements();
  operators_.swap_list.clear();
  operators_.length_list.clear();
  operators_.move_list.clear();
  for (std::size_t e = 0; e < mesh_.elements.size(); ++e) {
    if ((mesh_.elements[e].waits & pending::swap) != 0) operators_.swap_list.push_back(static_cast<LocalId>(e));
    if ((mesh_.elements[e].waits & pending::length) != 0) operators_.length_list.push_back(static_cast<LocalId>(e));
  }
  for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
    if (mesh_.vertices[v].waits) operators_.move_list.push_back(static_cast<LocalId>(v));
  }
}

template <int D, class Metric>
Real Remesher<D, Metric>::longest_waiting() const {
  Real longest = 0;
  for (const LocalId e : operators_.length_list) {
    if (mesh_.element(e).is_live())
      longest = std::max(longest, EdgeExtremes<D, Metric>(mesh_, mesh_.element(e)).longest);
  }
  return longest;
}

/// Splits the longest edge of each listed element if it is above the threshold. Elements with edges that are long or
/// short by the limits stay on the list.
template <int D, class Metric>
void Remesher<D, Metric>::split_pass(Real threshold) {
  std::vector<LocalId> list;
  list.swap(operators_.length_list);
  const Limits& limits = operators_.limits;
  for (const LocalId e : list) {
    mesh_.element(e).waits = static_cast<std::uint8_t>(mesh_.element(e).waits & ~pending::length);
    if (!mesh_.element(e).is_live()) continue;
    const EdgeExtremes<D, Metric> edges(mesh_, mesh_.element(e));
    if (edges.longest > threshold && operators_.split(e, edges.longest_edge)) continue;
    const bool later = edges.longest > limits.long_edge && edges.longest <= threshold;
    if (later || edges.shortest < limits.short_edge) operators_.enlist(e, pending::length);
  }
}

/// Collapses one of the element's edges below the threshold; edges refused before in this pass are not tried again.
template <int D, class Metric>
bool Remesher<D, Metric>::collapse_edges(LocalId e, Real threshold) {
  for (const auto& [i, j] : EdgeTable<D>::nodes) {
    const LocalId a = mesh_.element(e).node[i];
    const LocalId b = mesh_.element(e).node[j];
    if (mesh_.sizing_of(a, b) >= threshold) continue;
    const std::uint64_t key = edge_key(a, b);
    std::uint64_t& refused = refused_[static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 48)];
    if (refused == key) continue;
    if (operators_.collapse(a, b) || operators_.collapse(b, a)) return true;
    refused = key;
  }
  return false;
}

template <int D, class Metric>
void Remesher<D, Metric>::collapse_pass(Real threshold) {
  std::vector<LocalId> list;
  list.swap(operators_.length_list);
  refused_.assign(std::size_t{1} << 16, 0);
  for (const LocalId e : list) {
    mesh_.element(e).waits = static_cast<std::uint8_t>(mesh_.element(e).waits & ~pending::length);
    if (!mesh_.element(e).is_live()) continue;
    const EdgeExtremes<D, Metric> edges(mesh_, mesh_.element(e));
    if (edges.shortest < threshold && collapse_edges(e, threshold)) continue;
    if (edges.longest > operators_.limits.long_edge) operators_.enlist(e, pending::length);
  }
}

template <int D, class Metric>
void Remesher<D, Metric>::swap_pass(Real key) {
  std::vector<LocalId> list;
  list.swap(operators_.swap_list);
  for (const LocalId e : list) {
    Element<D>& element = mesh_.element(e);
    element.waits = static_cast<std::uint8_t>(element.waits & ~pending::swap);
    if (element.is_live() && element.key < key) operators_.swap_at(e);
  }
}

/// Turns edges towards six triangles at each vertex (three at the boundary).
template <int D, class Metric>
void Remesher<D, Metric>::balance_pass() {
  operators_.count_surplus();
  for (std::size_t e = 0; e < mesh_.elements.size(); ++e) {
    for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
      if (mesh_.elements[e].is_live()) operators_.balance(static_cast<LocalId>(e), edge);
    }
  }
}

template <int D, class Metric>
void Remesher<D, Metric>::move_pass() {
  std::vector<LocalId> list;
  list.swap(operators_.move_list);
  for (const LocalId v : list) {
    mesh_.vertex(v).waits = false;
    if (mesh_.vertex(v).element >= 0) operators_.relocate(v);
  }
}

/// What stays inverted at first is often free once the elements around it have become better.
template <int D, class Metric>
void Remesher<D, Metric>::untangle() {
  if (tangled_) timed("untangle", [&] { tangled_ = Untangler<D, Metric>(mesh_).run() > 0; });
}

template <int D, class Metric>
void Remesher<D, Metric>::settle_sizes() {
  constexpr int most_last_rounds = D == 3 ? 2 : 8;
  const Limits& limits = operators_.limits;
  int last_rounds = 0;
  Real threshold = std::numeric_limits<Real>::max();
  for (int round = 0; round < options_.size_rounds && last_rounds < most_last_rounds; ++round) {
    const OperationCounts before = operators_.counts;
    // Long edges that may not be split (of interfaces, of a kept surface) must not keep the others waiting.
    if (threshold > limits.long_edge)
      threshold = std::max(limits.long_edge, std::min(0.45 * longest_waiting(), 0.8 * threshold));
    timed("split", [&] { split_pass(threshold); });
    timed("collapse", [&] { collapse_pass(0.9 * limits.short_edge); });
    timed("swap", [&] { swap_pass(quality_to_key<D>(D == 3 ? 0.7 : 0.63)); });
    timed("move", [&] { move_pass(); });
    untangle();
    renumber_if_grown();
    if (threshold > limits.long_edge) continue;
    ++last_rounds;
    const std::int64_t changes =
        operators_.counts.splits - before.splits + operators_.counts.collapses - before.collapses;
    if (changes <= mesh_.count_vertices() / 200) break;
  }
}

template <int D, class Metric>
void Remesher<D, Metric>::improve() {
  operators_.limits.small_change = D == 3 ? 0.1F : 0.05F;
  operators_.limits.large_change = D == 3 ? 0.15F : 0.05F;
  enlist_all();
  for (int round = 0; round < options_.improvement_rounds; ++round) {
    const bool last = round + 1 == options_.improvement_rounds;
    if (D == 2 && round < 3) timed("balance", [&] { balance_pass(); });
    timed("swap", [&] { swap_pass(quality_to_key<D>(D == 3 ? 0.8 : 0.95)); });
    timed("collapse", [&] { collapse_pass(operators_.limits.short_edge); });
    if (!last) timed("split", [&] { split_pass(operators_.limits.long_edge); });
    timed("move", [&] { move_pass(); });
    untangle();
  }
}

/// The worst elements get all that is known to help, the worst first, until little is gained.
template <int D, class Metric>
void Remesher<D, Metric>::mend_worst() {
  constexpr int most_rounds = 5;
  const Real key = quality_to_key<D>(D == 3 ? 0.6 : 0.75);
  const auto most =
      static_cast<std::size_t>(200 + mesh_.count_elements() / 400);  // where all is bad, this helps little
  const Limits limits = operators_.limits;
  operators_.limits.swap_gain = 1.01;
  operators_.limits.collapse_gain = 1.01;
  operators_.limits.longest_made = 3.0;
  for (int round = 0; round < most_rounds; ++round) {
    std::vector<std::pair<float, LocalId>> worst;
    for (std::size_t e = 0; e < mesh_.elements.size(); ++e) {
      const Element<D>& element = mesh_.elements[e];
      if (element.is_live() && element.key > 0 && element.key < key)
        worst.emplace_back(element.key, static_cast<LocalId>(e));
    }
    std::sort(worst.begin(), worst.end());
    worst.resize(std::min(worst.size(), most));
    std::size_t mended = 0;
    for (const auto& [seen, e] : worst) {
      if (mesh_.element(e).is_live() && mesh_.element(e).key == seen && operators_.mend(e)) ++mended;
    }
    if (mended <= worst.size() / 20) break;
  }
  operators_.limits = limits;
}

template <int D, class Metric>
void Remesher<D, Metric>::run(RemeshReport& report) {
  ordered_elements_ = mesh_.count_elements();
  untangle();
  enlist_all();
  settle_sizes();
  improve();
  timed("worst", [&] { mend_worst(); });
  timed("renumber", [&] { renumber_all(); });
  report.splits = operators_.counts.splits;
  report.collapses = operators_.counts.collapses;
  report.swaps = operators_.counts.swaps;
  report.moves = operators_.counts.moves;
  report.phases.insert(report.phases.end(), phases_.begin(), phases_.end());
}

namespace {

/// Number of distinct edges, and of those whose metric length is in [1/sqrt 2, sqrt 2].
template <int D, class Metric>
std::pair<std::int64_t, std::int64_t> count_edges(const WorkingMesh<D, Metric>& mesh) {
  // The upper ends of all elements' edges, gathered by lower end.
  std::vector<LocalId> start(mesh.vertices.size() + 1, 0);
  const auto each_edge = [&](auto&& visit) {
    for (const auto& element : mesh.elements) {
      if (!element.is_live()) continue;
      for (const auto& [i, j] : EdgeTable<D>::nodes)
        visit(std::min(element.node[i], element.node[j]), std::max(element.node[i], element.node[j]));
    }
  };
  each_edge([&](LocalId low, LocalId) { ++start[static_cast<std::size_t>(low) + 1]; });
  for (std::size_t v = 1; v < start.size(); ++v) start[v] += start[v - 1];
  std::vector<LocalId> upper(static_cast<std::size_t>(start.back()));
  std::vector<LocalId> next(start.begin(), start.end() - 1);
  each_edge([&](LocalId low, LocalId high) {
    upper[static_cast<std::size_t>(next[static_cast<std::size_t>(low)]++)] = high;
  });
  std::vector<LocalId> seen(mesh.vertices.size(), -1);
  std::int64_t all = 0;
  std::int64_t good = 0;
  for (std::size_t v = 0; v + 1 < start.size(); ++v) {
    const auto low = static_cast<LocalId>(v);
    for (LocalId n = start[v]; n < start[v + 1]; ++n) {
      const LocalId high = upper[static_cast<std::size_t>(n)];
      if (seen[static_cast<std::size_t>(high)] == low) continue;
      seen[static_cast<std::size_t>(high)] = low;
      const Real length = mesh.squared_length_of(low, high);
      ++all;
      good += length >= 0.5 && length <= 2.0 ? 1 : 0;
    }
  }
  return {all, good};
}

}  // namespace

template <int D, class Metric>
RemeshQuality assess(const WorkingMesh<D, Metric>& mesh) {
  RemeshQuality quality;
  Real sum = 0;
  Real worst = 2;
  for (const auto& element : mesh.elements) {
    if (!element.is_live()) continue;
    worst = std::min<Real>(worst, element.key);
    sum += key_to_quality<D>(element.key);
    if (element.key <= 0) ++quality.inverted;
  }
  const auto [all, good] = count_edges(mesh);
  quality.minimum = worst > 0 ? key_to_quality<D>(worst) : worst;
  quality.mean = mesh.count_elements() > 0 ? sum / mesh.count_elements() : 0;
  quality.conforming = all == 0 ? 1 : static_cast<Real>(good) / static_cast<Real>(all);
  return quality;
}

template class Remesher<2, SizeMetric<2>>;
template class Remesher<2, TensorMetric<2>>;
template class Remesher<3, SizeMetric<3>>;
template class Remesher<3, TensorMetric<3>>;
template RemeshQuality assess(const WorkingMesh<2, SizeMetric<2>>&);
template RemeshQuality assess(const WorkingMesh<2, TensorMetric<2>>&);
template RemeshQuality assess(const WorkingMesh<3, SizeMetric<3>>&);
template RemeshQuality assess(const WorkingMesh<3, TensorMetric<3>>&);

}  // namespace malleus::remeshing
