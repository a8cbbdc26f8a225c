#include "remesh/distributed_metric.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/index.hpp"
#include "parallel/sparse_exchange.hpp"
#include "remesh/selection.hpp"
#include "remesh/vertex_metric.hpp"

namespace malleus {
namespace {

/// Copies' metrics are intersected into their owners', in rank order, and come back alike to all.
void level_metric(const Communicator& comm, const Mesh& mesh, Metric& metric) {
  const int n = metric.components();
  std::map<int, std::vector<Real>> outgoing;
  for (const auto& partner : mesh.node_halo.partners()) {
    for (const LocalId node : partner.receives) {
      const Real* from = metric.values().data() + index(node) * static_cast<std::size_t>(n);
      outgoing[partner.rank].insert(outgoing[partner.rank].end(), from, from + n);
    }
  }
  const auto incoming = sparse_exchange(comm, outgoing);
  for (const auto& partner : mesh.node_halo.partners()) {
    const auto found = incoming.find(partner.rank);
    if (found == incoming.end()) continue;
    const Real* from = found->second.data();
    for (const LocalId node : partner.sends) {
      intersect_at(metric, node, {from, static_cast<std::size_t>(n)});
      from += n;
    }
  }
  mesh.node_halo.update_copies(std::span(metric.values()), n);
}

/// Vertex metrics in the form of the remesher's kernels.
template <class VertexMetric>
std::vector<VertexMetric> vertex_metrics(const Mesh& mesh, const Metric& metric) {
  std::vector<VertexMetric> result(index(mesh.nodes()));
  const auto& values = metric.values();
  const auto n = static_cast<std::size_t>(metric.components());
  for (std::size_t v = 0; v < result.size(); ++v) {
    if constexpr (VertexMetric::is_tensor) {
      result[v] = VertexMetric::from_metric(std::span(values).subspan(v * n, n));
    } else {
      const Real size = metric.kind() == Metric::Kind::uniform ? values[0] : values[v];
      const Real inverse_square = 1 / (size * size);
      result[v] = VertexMetric::from_metric(std::span(&inverse_square, 1));
    }
  }
  return result;
}

struct EdgeCounts {
  GlobalId all = 0;
  GlobalId good = 0;
  Real shortest = 1e300;
  Real longest = 0;
};

template <int D, class VertexMetric>
class Fit {
 public:
  Fit(const Mesh& mesh, const Metric& metric) : mesh_(mesh), metrics_(vertex_metrics<VertexMetric>(mesh, metric)) {
    points_.resize(metrics_.size());
    for (std::size_t v = 0; v < points_.size(); ++v)
      std::copy_n(mesh.point(static_cast<LocalId>(v)), D, points_[v].begin());
  }

  MetricFit run(const Communicator& comm) const {
    MetricFit fit;
    measure_elements(comm, fit);
    measure_edges(comm, fit);
    return fit;
  }

  std::vector<std::uint8_t> misfits(const FitBounds& bounds) const {
    std::vector<std::uint8_t> result(index(mesh_.elements()), 0);
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      bool fits = quality_of(e) >= bounds.least_quality;
      const auto nodes = mesh_.nodes_of_element(e);
      for (const auto& [i, j] : remeshing::EdgeTable<D>::nodes) {
        const Real square = squared_length_of(index(nodes[i]), index(nodes[j]));
        fits = fits && square >= bounds.shortest && square <= bounds.longest;
      }
      result[index(e)] = fits ? 0 : 1;
    }
    return result;
  }

 private:
  remeshing::PointPointers<D> points_of(LocalId e) const {
    remeshing::PointPointers<D> x;
    for (std::size_t k = 0; k <= D; ++k) x[k] = &points_[index(mesh_.nodes_of_element(e)[k])];
    return x;
  }
  Real quality_of(LocalId e) const {
    remeshing::MetricPointers<D, VertexMetric> m;
    for (std::size_t k = 0; k <= D; ++k) m[k] = &metrics_[index(mesh_.nodes_of_element(e)[k])];
    return remeshing::key_to_quality<D>(remeshing::shape_key<D>(points_of(e), m));
  }
  Real squared_length_of(std::size_t a, std::size_t b) const {
    return remeshing::squared_length<D>(points_[a], metrics_[a], points_[b], metrics_[b]);
  }

  void measure_elements(const Communicator& comm, MetricFit& fit) const {
    constexpr std::size_t bins = 1000;
    std::vector<GlobalId> histogram(bins, 0);
    Real worst = 2;
    Real sum = 0;
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      const Real quality = quality_of(e);
      fit.volume += remeshing::scaled_volume<D>(points_of(e)) / remeshing::factorial<D>;
      worst = std::min(worst, quality);
      fit.inverted += quality > 0 ? 0 : 1;
      sum += quality;
      ++histogram[std::min(bins - 1, static_cast<std::size_t>(quality * bins))];
    }
    comm.sum_in_place(std::span(histogram));
    fit.quality_min = comm.min(worst);
    fit.quality_mean = comm.sum(sum) / static_cast<Real>(std::max<GlobalId>(1, mesh_.total_elements));
    fit.volume = comm.sum(fit.volume);
    fit.inverted = comm.sum(fit.inverted);
    const Real wanted = 0.01 * static_cast<Real>(mesh_.total_elements);
    Real below = 0;
    std::size_t bin = 0;
    while (bin + 1 < bins && below + static_cast<Real>(histogram[bin]) < wanted)
      below += static_cast<Real>(histogram[bin++]);
    const auto here = static_cast<Real>(std::max<GlobalId>(1, histogram[bin]));
    fit.quality_p01 = std::max(fit.quality_min, (static_cast<Real>(bin) + (wanted - below) / here) / bins);
  }

  /// Calls visit(a, b) once for each edge, a < b: the upper ends of all elements' edges are gathered by lower end.
  template <class Visit>
  void visit_edges(Visit&& visit) const {
    std::vector<std::int64_t> start(points_.size() + 1, 0);
    const auto each = [&](auto&& take) {
      for (LocalId e = 0; e < mesh_.elements(); ++e) {
        const auto nodes = mesh_.nodes_of_element(e);
        for (const auto& [i, j] : remeshing::EdgeTable<D>::nodes)
          take(index(std::min(nodes[i], nodes[j])), std::max(nodes[i], nodes[j]));
      }
    };
    each([&](std::size_t low, LocalId) { ++start[low + 1]; });
    for (std::size_t v = 1; v < start.size(); ++v) start[v] += start[v - 1];
    std::vector<LocalId> upper(static_cast<std::size_t>(start.back()));
    std::vector<std::int64_t> next(start.begin(), start.end() - 1);
    each([&](std::size_t low, LocalId high) { upper[static_cast<std::size_t>(next[low]++)] = high; });
    std::vector<LocalId> seen(points_.size(), -1);
    for (std::size_t low = 0; low < points_.size(); ++low) {
      for (std::int64_t n = start[low]; n < start[low + 1]; ++n) {
        const LocalId high = upper[static_cast<std::size_t>(n)];
        if (seen[index(high)] == static_cast<LocalId>(low)) continue;
        seen[index(high)] = static_cast<LocalId>(low);
        visit(low, index(high));
      }
    }
  }

  void measure_edges(const Communicator& comm, MetricFit& fit) const {
    EdgeCounts counts;
    visit_edges([&](std::size_t a, std::size_t b) {
      const Real square = squared_length_of(a, b);
      ++counts.all;
      counts.good += square >= 0.5 && square <= 2 ? 1 : 0;
      counts.shortest = std::min(counts.shortest, square);
      counts.longest = std::max(counts.longest, square);
    });
    const GlobalId all = comm.sum(counts.all);
    fit.conforming = all == 0 ? 1 : static_cast<Real>(comm.sum(counts.good)) / static_cast<Real>(all);
    fit.edge_min = std::sqrt(comm.min(counts.shortest));
    fit.edge_max = std::sqrt(comm.max(counts.longest));
  }

  const Mesh& mesh_;
  std::vector<VertexMetric> metrics_;
  std::vector<remeshing::Point<D>> points_;
};

}  // namespace

Metric current_sizes(const Communicator& /*the halo knows it*/, const Mesh& mesh) {
  std::vector<Real> sums(2 * index(mesh.nodes()), 0);  // [node] sum of lengths, count
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId a : mesh.nodes_of_element(e)) {
      for (const LocalId b : mesh.nodes_of_element(e)) {
        if (a == b) continue;
        Real square = 0;
        for (int c = 0; c < mesh.dim; ++c) {
          const Real d = mesh.point(a)[c] - mesh.point(b)[c];
          square += d * d;
        }
        sums[2 * index(a)] += std::sqrt(square);
        sums[2 * index(a) + 1] += 1;
      }
    }
  }
  mesh.node_halo.add_to_owners(std::span(sums), 2);
  mesh.node_halo.update_copies(std::span(sums), 2);
  std::vector<Real> sizes(index(mesh.nodes()));
  for (std::size_t node = 0; node < sizes.size(); ++node) sizes[node] = sums[2 * node] / sums[2 * node + 1];
  return Metric::per_node(std::move(sizes));
}

void limit_gradation(const Communicator& comm, const Mesh& mesh, Metric& metric, Real beta) {
  if (metric.kind() == Metric::Kind::uniform || !(beta > 1)) return;
  constexpr int most_rounds = 100;  // each carries small sizes one rank farther; a guard against creeping tensors
  const RemeshMesh arrays = local_arrays(mesh);
  for (int round = 0; round < most_rounds; ++round) {
    limit_gradation(arrays, metric, beta);
    if (comm.size() == 1) return;
    const std::vector<Real> before = metric.values();
    level_metric(comm, mesh, metric);
    bool changed = false;
    for (std::size_t i = 0; i < before.size(); ++i)
      changed = changed || std::abs(metric.values()[i] - before[i]) > 2e-3 * std::abs(before[i]);
    if (!comm.any(changed)) return;
  }
}

Real predicted_elements(const Communicator& comm, const Mesh& mesh, const Metric& metric) {
  return comm.sum(predicted_elements(local_arrays(mesh), metric));
}

void scale_to_nodes(const Communicator& comm, const Mesh& mesh, Metric& metric, Real nodes, Real smallest,
                    Real largest) {
  const RemeshMesh arrays = local_arrays(mesh);
  const Real wanted = nodes * predicted_per_node(mesh.dim);
  constexpr int most_steps = 30;  // bounds take effect on part of the nodes: a few steps settle the rest
  for (int step = 0; step < most_steps; ++step) {
    const Real now = comm.sum(predicted_elements(arrays, metric));
    if (!(now > 0) || std::abs(now - wanted) <= 1e-3 * wanted) return;
    scale_sizes(metric, std::pow(now / wanted, 1.0 / mesh.dim));
    bound_sizes(metric, smallest, largest);
  }
}

namespace {

template <class Visit>
auto with_fit(const Mesh& mesh, const Metric& metric, Visit&& visit) {
  const bool tensors = metric.kind() == Metric::Kind::tensors;
  if (mesh.dim == 2)
    return tensors ? visit(Fit<2, remeshing::TensorMetric<2>>(mesh, metric))
                   : visit(Fit<2, remeshing::SizeMetric<2>>(mesh, metric));
  return tensors ? visit(Fit<3, remeshing::TensorMetric<3>>(mesh, metric))
                 : visit(Fit<3, remeshing::SizeMetric<3>>(mesh, metric));
}

}  // namespace

MetricFit metric_fit(const Communicator& comm, const Mesh& mesh, const Metric& metric) {
  return with_fit(mesh, metric, [&](const auto& fit) { return fit.run(comm); });
}

std::vector<std::uint8_t> misfits(const Mesh& mesh, const Metric& metric, const FitBounds& bounds) {
  return with_fit(mesh, metric, [&](const auto& fit) { return fit.misfits(bounds); });
}

}  // namespace malleus
