#include "remesh/error_metric.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/index.hpp"
#include "mesh/simplex.hpp"
#include "remesh/distributed_metric.hpp"
#include "remesh/symmetric_tensor.hpp"

namespace malleus {
namespace {

/// Means over the elements at each node, weighted by volume: of(element, into) adds `width` values. Collective.
template <int D, class OfElement>
std::vector<Real> average_at_nodes(const Mesh& mesh, int width, OfElement&& of) {
  const auto stride = static_cast<std::size_t>(width) + 1;
  std::vector<Real> sums(index(mesh.nodes()) * stride, 0);
  std::vector<Real> values(static_cast<std::size_t>(width));
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const Real weight = of(e, values);
    for (const LocalId node : mesh.nodes_of_element(e)) {
      Real* sum = sums.data() + index(node) * stride;
      for (std::size_t c = 0; c + 1 < stride; ++c) sum[c] += weight * values[c];
      sum[stride - 1] += weight;
    }
  }
  mesh.node_halo.add_to_owners(std::span(sums), width + 1);
  mesh.node_halo.update_copies(std::span(sums), width + 1);
  std::vector<Real> means(index(mesh.nodes()) * static_cast<std::size_t>(width));
  for (std::size_t node = 0; node < index(mesh.nodes()); ++node) {
    const Real weight = sums[node * stride + stride - 1];
    for (std::size_t c = 0; c + 1 < stride; ++c)
      means[node * (stride - 1) + c] = weight > 0 ? sums[node * stride + c] / weight : 0;
  }
  return means;
}

/// Gradients [node][component][D] of values [node][components].
template <int D>
std::vector<Real> recovered_gradients(const Mesh& mesh, std::span<const Real> values, int components) {
  return average_at_nodes<D>(mesh, components * D, [&](LocalId e, std::vector<Real>& out) {
    const auto p1 = p1_gradients<D>(simplex_points<D>(mesh, e));
    std::fill(out.begin(), out.end(), 0.0);
    const auto nodes = mesh.nodes_of_element(e);
    for (int k = 0; k <= D; ++k) {
      for (int c = 0; c < components; ++c) {
        const Real value = values[index(nodes[static_cast<std::size_t>(k)]) * static_cast<std::size_t>(components) +
                                  static_cast<std::size_t>(c)];
        for (int i = 0; i < D; ++i) out[static_cast<std::size_t>(c * D + i)] += value * p1.gradients(i, k);
      }
    }
    return std::abs(p1.volume);
  });
}

/// One-sided means at the boundary give bad Hessians there: inner neighbours' take their place.
template <int D>
void take_from_inside(const Mesh& mesh, std::vector<Real>& values, int width) {
  std::vector<Real> outer(index(mesh.nodes()), 0);
  for (LocalId f = 0; f < mesh.exterior_facets; ++f) {
    for (const LocalId node : mesh.nodes_of_facet(f)) outer[index(node)] = 1;
  }
  mesh.node_halo.max_to_owners(std::span(outer), 1);
  mesh.node_halo.update_copies(std::span(outer), 1);
  const auto n = static_cast<std::size_t>(width);
  constexpr int most_rings = 3;  // corners may have no inner neighbour at first
  for (int ring = 0; ring < most_rings; ++ring) {
    std::vector<Real> sums(index(mesh.nodes()) * (n + 1), 0);
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      for (const LocalId from : mesh.nodes_of_element(e)) {
        if (outer[index(from)] != 0) continue;
        for (const LocalId to : mesh.nodes_of_element(e)) {
          if (outer[index(to)] == 0) continue;
          for (std::size_t c = 0; c < n; ++c) sums[index(to) * (n + 1) + c] += values[index(from) * n + c];
          sums[index(to) * (n + 1) + n] += 1;
        }
      }
    }
    mesh.node_halo.add_to_owners(std::span(sums), width + 1);
    mesh.node_halo.update_copies(std::span(sums), width + 1);
    for (std::size_t node = 0; node < outer.size(); ++node) {
      const Real count = sums[node * (n + 1) + n];
      if (outer[node] == 0 || count == 0) continue;
      for (std::size_t c = 0; c < n; ++c) values[node * n + c] = sums[node * (n + 1) + c] / count;
      outer[node] = 0;
    }
  }
}

/// |H| of all components together, [node][symmetric].
template <int D>
std::vector<Real> absolute_hessians(const Mesh& mesh, const Field& field) {
  using remeshing::packed;
  const int components = field.components();
  const std::vector<Real> gradients = recovered_gradients<D>(mesh, field.values(), components);
  std::vector<Real> hessians = recovered_gradients<D>(mesh, gradients, components * D);
  take_from_inside<D>(mesh, hessians, components * D * D);
  constexpr auto size = static_cast<std::size_t>(remeshing::symmetric_size<D>);
  std::vector<Real> result(index(mesh.nodes()) * size, 0);
  for (std::size_t node = 0; node < index(mesh.nodes()); ++node) {
    for (int c = 0; c < components; ++c) {
      const Real* h =
          hessians.data() + (node * static_cast<std::size_t>(components) + static_cast<std::size_t>(c)) * D * D;
      remeshing::Symmetric<D> symmetric{};
      for (int i = 0; i < D; ++i) {
        for (int j = 0; j <= i; ++j) symmetric[packed(i, j)] = 0.5 * (h[i * D + j] + h[j * D + i]);
      }
      const auto absolute = remeshing::map_eigenvalues<D>(symmetric, [](Real value) { return std::abs(value); });
      for (std::size_t i = 0; i < size; ++i) result[node * size + i] += absolute[i];
    }
  }
  return result;
}

template <int D>
Metric error_metric_of(const Communicator& comm, const Mesh& mesh, const Field& field, Real nodes,
                       const ErrorMetricOptions& options) {
  constexpr auto size = static_cast<std::size_t>(remeshing::symmetric_size<D>);
  std::vector<Real> tensors = absolute_hessians<D>(mesh, field);
  Real largest = 0;
  for (std::size_t i = 0; i < tensors.size(); i += size) {
    for (int k = 0; k < D; ++k)
      largest = std::max(largest, tensors[i + static_cast<std::size_t>(remeshing::packed(k, k))]);
  }
  largest = comm.max(largest);
  // Curvatures below a share of the largest count as that: a linear field asks for equal sizes.
  constexpr Real smallest_share = 1e-5;
  const Real floor = largest > 0 ? smallest_share * largest : 1;
  std::vector<Real> sizes;
  for (std::size_t i = 0; i < tensors.size(); i += size) {
    remeshing::Symmetric<D> h;
    std::copy_n(tensors.begin() + static_cast<std::ptrdiff_t>(i), size, h.begin());
    auto system = remeshing::eigen_system<D>(h);
    Real log_determinant = 0;
    const Real steepest = system.values[D - 1];
    for (Real& value : system.values) {
      value = std::max(options.anisotropic ? value : steepest, floor);
      log_determinant += std::log(value);
    }
    const Real factor = std::exp(-log_determinant / (4 + D));
    for (Real& value : system.values) value *= factor;
    const auto metric = remeshing::compose<D>(system);
    std::copy(metric.begin(), metric.end(), tensors.begin() + static_cast<std::ptrdiff_t>(i));
    sizes.push_back(1 / std::sqrt(system.values[D - 1]));
  }
  Metric metric = options.anisotropic ? Metric::tensors(D, std::move(tensors)) : Metric::per_node(std::move(sizes));
  scale_to_nodes(comm, mesh, metric, nodes, options.smallest, options.largest);
  return metric;
}

/// Squares of the gradient and of its distance to the recovered one, integrated over each element.
template <int D>
struct GradientErrors {
  std::vector<Real> squares;  ///< [element] of the error
  Real norm = 0;              ///< square of the gradient's norm over all ranks
};

template <int D>
GradientErrors<D> gradient_errors(const Communicator& comm, const Mesh& mesh, const Field& field) {
  const int components = field.components();
  const std::vector<Real> recovered = recovered_gradients<D>(mesh, field.values(), components);
  GradientErrors<D> errors;
  std::vector<Real> here(static_cast<std::size_t>(components * D));
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto p1 = p1_gradients<D>(simplex_points<D>(mesh, e));
    std::fill(here.begin(), here.end(), 0.0);
    const auto nodes = mesh.nodes_of_element(e);
    for (int k = 0; k <= D; ++k) {
      for (int c = 0; c < components; ++c) {
        for (int i = 0; i < D; ++i)
          here[static_cast<std::size_t>(c * D + i)] +=
              field.at(nodes[static_cast<std::size_t>(k)])[c] * p1.gradients(i, k);
      }
    }
    Real square = 0;
    Real norm = 0;
    for (std::size_t i = 0; i < here.size(); ++i) {
      norm += here[i] * here[i];
      for (const LocalId node : nodes) {
        const Real away = recovered[index(node) * here.size() + i] - here[i];
        square += away * away / (D + 1);
      }
    }
    errors.squares.push_back(square * std::abs(p1.volume));
    errors.norm += norm * std::abs(p1.volume);
  }
  errors.norm = comm.sum(errors.norm);
  return errors;
}

template <int D>
Metric error_sizes_of(const Communicator& comm, const Mesh& mesh, const Field& field, Real error,
                      const ErrorMetricOptions& options) {
  constexpr Real largest_growth = 4;
  constexpr Real power = 1.0 / (2 + D);  // of the squared error of an element, for first order
  const GradientErrors<D> errors = gradient_errors<D>(comm, mesh, field);
  Metric sizes = current_sizes(comm, mesh);
  if (!(errors.norm > 0)) return sizes;
  Real sum = 0;
  for (const Real square : errors.squares) sum += std::pow(square, D * power);
  const Real allowed = error * std::sqrt(errors.norm) / std::sqrt(std::max(comm.sum(sum), 1e-300));
  // The smallest ratio of new to old size among the elements at a node.
  std::vector<Real> ratio(index(mesh.nodes()), largest_growth);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const Real eta = std::pow(errors.squares[index(e)], power);
    const Real here = eta * largest_growth > allowed ? allowed / eta : largest_growth;
    for (const LocalId node : mesh.nodes_of_element(e)) ratio[index(node)] = std::min(ratio[index(node)], here);
  }
  mesh.node_halo.min_to_owners(std::span(ratio), 1);
  mesh.node_halo.update_copies(std::span(ratio), 1);
  for (std::size_t node = 0; node < ratio.size(); ++node) {
    sizes.values()[node] = std::clamp(sizes.values()[node] * std::max(ratio[node], 1.0 / largest_growth),
                                      options.smallest, options.largest);
  }
  return sizes;
}

}  // namespace

Metric error_sizes(const Communicator& comm, const Mesh& mesh, const Field& field, Real error,
                   const ErrorMetricOptions& options) {
  check(field.spec().support == Support::node, "error sizes are of node fields");
  return mesh.dim == 2 ? error_sizes_of<2>(comm, mesh, field, error, options)
                       : error_sizes_of<3>(comm, mesh, field, error, options);
}

Metric error_metric(const Communicator& comm, const Mesh& mesh, const Field& field, Real nodes,
                    const ErrorMetricOptions& options) {
  check(field.spec().support == Support::node, "error metrics are of node fields");
  return mesh.dim == 2 ? error_metric_of<2>(comm, mesh, field, nodes, options)
                       : error_metric_of<3>(comm, mesh, field, nodes, options);
}

}  // namespace malleus
