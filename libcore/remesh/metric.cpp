#include "remesh/metric.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/error.hpp"
#include "remesh/symmetric_tensor.hpp"

namespace malleus {
namespace {

template <int D>
bool is_positive(const Real* tensor) {
  remeshing::Symmetric<D> m;
  for (std::size_t i = 0; i < m.size(); ++i) {
    if (!std::isfinite(tensor[i])) return false;
    m[i] = tensor[i];
  }
  return remeshing::eigen_system<D>(m).values[0] > 0;
}

}  // namespace

Metric Metric::uniform(Real size) {
  if (!(size > 0) || !std::isfinite(size)) throw InputError(fmt::format("metric: size {} is not positive", size));
  return {Kind::uniform, 1, {size}};
}

Metric Metric::per_node(std::vector<Real> sizes) {
  for (std::size_t n = 0; n < sizes.size(); ++n) {
    if (!(sizes[n] > 0) || !std::isfinite(sizes[n]))
      throw InputError(fmt::format("metric: size {} of node {} is not positive", sizes[n], n));
  }
  return {Kind::sizes, 1, std::move(sizes)};
}

Metric Metric::tensors(int dimension, std::vector<Real> tensors) {
  const int components = dimension * (dimension + 1) / 2;
  const auto stride = static_cast<std::size_t>(components);
  for (std::size_t n = 0; n + stride <= tensors.size(); n += stride) {
    const bool positive = dimension == 2 ? is_positive<2>(&tensors[n]) : is_positive<3>(&tensors[n]);
    if (!positive) throw InputError(fmt::format("metric: the tensor of node {} is not positive", n / stride));
  }
  return {Kind::tensors, components, std::move(tensors)};
}

void check_metric(const RemeshMesh& mesh, const Metric& metric) {
  if (metric.kind() == Metric::Kind::uniform) return;
  const int components = mesh.dimension * (mesh.dimension + 1) / 2;
  if (metric.kind() == Metric::Kind::tensors && metric.components() != components)
    throw InputError(fmt::format("metric: {} components a node, {} expected in {}D", metric.components(), components,
                                 mesh.dimension));
  const std::size_t wanted = static_cast<std::size_t>(mesh.nodes()) * static_cast<std::size_t>(metric.components());
  if (metric.values().size() != wanted)
    throw InputError(
        fmt::format("metric: {} values for {} nodes, {} expected", metric.values().size(), mesh.nodes(), wanted));
}

}  // namespace malleus
