#include "remesh/metric_tools.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>

#include "remesh/symmetric_tensor.hpp"
#include "remesh/vertex_metric.hpp"

namespace malleus {
namespace {

using namespace remeshing;

template <int D>
Symmetric<D> tensor_at(const Metric& metric, std::size_t node) {
  const auto& values = metric.values();
  Symmetric<D> m{};
  if (metric.kind() == Metric::Kind::tensors) {
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(node * m.size()), m.size(), m.begin());
    return m;
  }
  const Real size = metric.kind() == Metric::Kind::uniform ? values[0] : values[node];
  for (int i = 0; i < D; ++i) m[packed(i, i)] = 1 / (size * size);
  return m;
}

template <int D>
void store(Metric& metric, std::size_t node, const Symmetric<D>& m) {
  std::copy(m.begin(), m.end(), metric.values().begin() + static_cast<std::ptrdiff_t>(node * m.size()));
}

/// The largest ellipsoid-wise smaller metric of two: in the basis that makes both diagonal, the larger entries.
template <int D>
Symmetric<D> intersection(const Symmetric<D>& a, const Symmetric<D>& b) {
  // b in the space where a is the identity: S = a^(-1/2) b a^(-1/2) = R diag(s) R^T.
  const EigenSystem<D> ea = eigen_system<D>(a);
  std::array<Point<D>, D> half{};  // columns: axes of a, scaled by 1 / sqrt(eigenvalue)
  for (std::size_t k = 0; k < D; ++k) half[k] = shifted<D>({}, ea.vectors[k], 1 / std::sqrt(ea.values[k]));
  Symmetric<D> reduced{};
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j <= i; ++j) {
      Real sum = 0;
      for (int k = 0; k < D; ++k) {
        for (int l = 0; l < D; ++l) {
          sum += half[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)] * b[packed(k, l)] *
                 half[static_cast<std::size_t>(j)][static_cast<std::size_t>(l)];
        }
      }
      reduced[packed(i, j)] = sum;
    }
  }
  const EigenSystem<D> es = eigen_system<D>(reduced);
  // Common axes as covectors w_k = a^(1/2) r_k: the result is sum max(1, s_k) w_k w_k^T.
  Symmetric<D> result{};
  for (std::size_t k = 0; k < D; ++k) {
    Point<D> w{};
    for (std::size_t i = 0; i < D; ++i) w = shifted<D>(w, ea.vectors[i], std::sqrt(ea.values[i]) * es.vectors[k][i]);
    const Real factor = std::max(1.0, es.values[k]);
    for (int i = 0; i < D; ++i) {
      for (int j = 0; j <= i; ++j)
        result[packed(i, j)] += factor * w[static_cast<std::size_t>(i)] * w[static_cast<std::size_t>(j)];
    }
  }
  return result;
}

/// Neighbours of each node along edges, as offsets and a flat list.
struct NodeGraph {
  std::vector<LocalId> offsets;
  std::vector<LocalId> neighbours;
};

NodeGraph node_graph(const RemeshMesh& mesh) {
  std::vector<std::uint64_t> edges;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (const LocalId a : nodes) {
      for (const LocalId b : nodes) {
        if (a != b) edges.push_back((static_cast<std::uint64_t>(a) << 32) | static_cast<std::uint64_t>(b));
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  NodeGraph graph;
  graph.offsets.assign(static_cast<std::size_t>(mesh.nodes()) + 1, 0);
  for (const auto edge : edges) {
    ++graph.offsets[static_cast<std::size_t>(edge >> 32) + 1];
    graph.neighbours.push_back(static_cast<LocalId>(edge & 0xffffffffU));
  }
  for (std::size_t n = 1; n < graph.offsets.size(); ++n) graph.offsets[n] += graph.offsets[n - 1];
  return graph;
}

template <int D>
Point<D> point_at(const RemeshMesh& mesh, LocalId node) {
  Point<D> x;
  std::copy_n(mesh.point(node), D, x.begin());
  return x;
}

/// Bounds one node's metric by a neighbour's; true where that changed it by more than a per mille.
template <int D>
bool bound_by(const RemeshMesh& mesh, Metric& metric, LocalId node, LocalId other, Real growth) {
  const Point<D> edge = difference<D>(point_at<D>(mesh, node), point_at<D>(mesh, other));
  const auto n = static_cast<std::size_t>(node);
  const auto o = static_cast<std::size_t>(other);
  if (metric.kind() == Metric::Kind::sizes) {
    auto& sizes = metric.values();
    const Real limit = sizes[o] + growth * std::sqrt(dot(edge, edge));
    if (sizes[n] <= 1.001 * limit) return false;
    sizes[n] = limit;
    return true;
  }
  Symmetric<D> spread = tensor_at<D>(metric, o);
  const Real grown = 1 + growth * std::sqrt(quadratic_form(spread, edge));
  for (Real& value : spread) value /= grown * grown;
  const Symmetric<D> mine = tensor_at<D>(metric, n);
  const Symmetric<D> both = intersection<D>(mine, spread);
  Real change = 0;
  for (int i = 0; i < D; ++i) change = std::max(change, both[packed(i, i)] / mine[packed(i, i)]);
  if (change <= 1.002) return false;
  store<D>(metric, n, both);
  return true;
}

template <int D>
Real sort_key(const Metric& metric, LocalId node) {
  if (metric.kind() == Metric::Kind::sizes) return metric.values()[static_cast<std::size_t>(node)];
  const auto m = tensor_at<D>(metric, static_cast<std::size_t>(node));
  return 1 / eigen_system<D>(m).values[D - 1];
}

template <int D>
void grade(const RemeshMesh& mesh, Metric& metric, Real growth) {
  const NodeGraph graph = node_graph(mesh);
  std::vector<LocalId> order(static_cast<std::size_t>(mesh.nodes()));
  std::iota(order.begin(), order.end(), 0);
  std::vector<Real> keys;
  for (const LocalId node : order) keys.push_back(sort_key<D>(metric, node));
  std::stable_sort(order.begin(), order.end(), [&](LocalId a, LocalId b) {
    return keys[static_cast<std::size_t>(a)] < keys[static_cast<std::size_t>(b)];
  });
  std::deque<LocalId> list(order.begin(), order.end());
  std::vector<char> waits(order.size(), 1);
  // Each node can come back only as long as it still shrinks; the cap guards against creeping tensors.
  for (std::size_t visits = 0; !list.empty() && visits < 50 * order.size(); ++visits) {
    const LocalId node = list.front();
    list.pop_front();
    waits[static_cast<std::size_t>(node)] = 0;
    for (LocalId k = graph.offsets[static_cast<std::size_t>(node)];
         k < graph.offsets[static_cast<std::size_t>(node) + 1]; ++k) {
      const LocalId other = graph.neighbours[static_cast<std::size_t>(k)];
      if (!bound_by<D>(mesh, metric, other, node, growth) || waits[static_cast<std::size_t>(other)]) continue;
      waits[static_cast<std::size_t>(other)] = 1;
      list.push_back(other);
    }
  }
}

template <int D>
void bound(Metric& metric, Real smallest, Real largest) {
  const Real low = 1 / (largest * largest);
  const Real high = 1 / (smallest * smallest);
  const std::size_t n = metric.values().size() / static_cast<std::size_t>(symmetric_size<D>);
  for (std::size_t node = 0; node < n; ++node) {
    store<D>(metric, node,
             map_eigenvalues<D>(tensor_at<D>(metric, node), [&](Real value) { return std::clamp(value, low, high); }));
  }
}

/// ln det M at each node.
template <int D>
std::vector<Real> log_determinants(const RemeshMesh& mesh, const Metric& metric) {
  std::vector<Real> logs(static_cast<std::size_t>(mesh.nodes()), 0);
  for (std::size_t node = 0; node < logs.size(); ++node) {
    if (metric.kind() != Metric::Kind::tensors) {
      logs[node] = -2 * D * std::log(metric.values()[metric.kind() == Metric::Kind::uniform ? 0 : node]);
      continue;
    }
    for (const Real value : eigen_system<D>(tensor_at<D>(metric, node)).values) logs[node] += std::log(value);
  }
  return logs;
}

/// Volumes of the elements in metric space.
template <int D>
std::vector<Real> metric_volumes(const RemeshMesh& mesh, const Metric& metric) {
  const std::vector<Real> logs = log_determinants<D>(mesh, metric);
  std::vector<Real> volumes(static_cast<std::size_t>(mesh.elements()));
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    std::array<Point<D>, D + 1> x;
    PointPointers<D> pointers;
    const auto nodes = mesh.nodes_of_element(e);
    Real log_determinant = 0;
    for (std::size_t k = 0; k <= D; ++k) {
      x[k] = point_at<D>(mesh, nodes[k]);
      pointers[k] = &x[k];
      log_determinant += logs[static_cast<std::size_t>(nodes[k])] / (D + 1);
    }
    volumes[static_cast<std::size_t>(e)] =
        std::abs(scaled_volume<D>(pointers)) / factorial<D> * std::exp(0.5 * log_determinant);
  }
  return volumes;
}

}  // namespace

void bound_sizes(Metric& metric, Real smallest, Real largest) {
  if (metric.kind() == Metric::Kind::tensors) {
    metric.components() == 3 ? bound<2>(metric, smallest, largest) : bound<3>(metric, smallest, largest);
  } else {
    for (Real& size : metric.values()) size = std::clamp(size, smallest, largest);
  }
}

void limit_gradation(const RemeshMesh& mesh, Metric& metric, Real beta) {
  if (metric.kind() == Metric::Kind::uniform || !(beta > 1)) return;
  const Real growth = std::log(beta);
  mesh.dimension == 2 ? grade<2>(mesh, metric, growth) : grade<3>(mesh, metric, growth);
}

Metric intersect(const RemeshMesh& mesh, const Metric& a, const Metric& b) {
  const auto n = static_cast<std::size_t>(mesh.nodes());
  const auto both_kind = [&](Metric::Kind kind) { return a.kind() == kind || b.kind() == kind; };
  if (!both_kind(Metric::Kind::tensors)) {
    if (a.kind() == Metric::Kind::uniform && b.kind() == Metric::Kind::uniform)
      return Metric::uniform(std::min(a.values()[0], b.values()[0]));
    std::vector<Real> sizes(n);
    const auto size_of = [](const Metric& m, std::size_t node) {
      return m.kind() == Metric::Kind::uniform ? m.values()[0] : m.values()[node];
    };
    for (std::size_t node = 0; node < n; ++node) sizes[node] = std::min(size_of(a, node), size_of(b, node));
    return Metric::per_node(std::move(sizes));
  }
  std::vector<Real> tensors;
  const auto each = [&]<int D>(std::integral_constant<int, D>) {
    for (std::size_t node = 0; node < n; ++node) {
      const auto m = intersection<D>(tensor_at<D>(a, node), tensor_at<D>(b, node));
      tensors.insert(tensors.end(), m.begin(), m.end());
    }
  };
  mesh.dimension == 2 ? each(std::integral_constant<int, 2>{}) : each(std::integral_constant<int, 3>{});
  return Metric::tensors(mesh.dimension, std::move(tensors));
}

void intersect_at(Metric& metric, LocalId node, std::span<const Real> other) {
  const auto n = static_cast<std::size_t>(node);
  if (metric.kind() == Metric::Kind::sizes) {
    metric.values()[n] = std::min(metric.values()[n], other[0]);
    return;
  }
  const auto cut = [&]<int D>(std::integral_constant<int, D>) {
    Symmetric<D> b;
    std::copy_n(other.begin(), b.size(), b.begin());
    const Symmetric<D> a = tensor_at<D>(metric, n);
    if (a != b) store<D>(metric, n, intersection<D>(a, b));
  };
  metric.components() == 3 ? cut(std::integral_constant<int, 2>{}) : cut(std::integral_constant<int, 3>{});
}

std::vector<Real> predicted_elements_of_each(const RemeshMesh& mesh, const Metric& metric) {
  const Real unit = mesh.dimension == 2 ? std::sqrt(3.0) / 4 : std::sqrt(2.0) / 12;
  std::vector<Real> counts = mesh.dimension == 2 ? metric_volumes<2>(mesh, metric) : metric_volumes<3>(mesh, metric);
  for (Real& count : counts) count /= unit;
  return counts;
}

Real predicted_elements(const RemeshMesh& mesh, const Metric& metric) {
  const std::vector<Real> counts = predicted_elements_of_each(mesh, metric);
  return std::accumulate(counts.begin(), counts.end(), 0.0);
}

void scale_sizes(Metric& metric, Real factor) {
  const bool tensors = metric.kind() == Metric::Kind::tensors;
  for (Real& value : metric.values()) value *= tensors ? 1 / (factor * factor) : factor;
}

void scale_to_nodes(const RemeshMesh& mesh, Metric& metric, Real nodes) {
  const Real now = predicted_elements(mesh, metric) / predicted_per_node(mesh.dimension);
  if (!(now > 0) || !(nodes > 0)) return;
  scale_sizes(metric, std::pow(now / nodes, 1.0 / mesh.dimension));
}

Metric current_sizes(const RemeshMesh& mesh) {
  const NodeGraph graph = node_graph(mesh);
  std::vector<Real> sizes(static_cast<std::size_t>(mesh.nodes()), 1);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const auto n = static_cast<std::size_t>(node);
    Real sum = 0;
    for (LocalId k = graph.offsets[n]; k < graph.offsets[n + 1]; ++k) {
      const Real* a = mesh.point(node);
      const Real* b = mesh.point(graph.neighbours[static_cast<std::size_t>(k)]);
      Real square = 0;
      for (int i = 0; i < mesh.dimension; ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
      sum += std::sqrt(square);
    }
    if (sum > 0) sizes[n] = sum / (graph.offsets[n + 1] - graph.offsets[n]);
  }
  return Metric::per_node(std::move(sizes));
}

}  // namespace malleus
