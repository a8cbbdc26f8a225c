#include "inject/front_sizes.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "mesh/simplex.hpp"
#include "remesh/metric_tools.hpp"

namespace malleus::inject {
namespace {

constexpr Real front_band = 6;         ///< of fine elements on each side of a front
constexpr Real tolerated_share = 0.2;  ///< of the edges that a front cuts may be longer
constexpr Real tolerated_size = 2;     ///< times min_size

const std::optional<Real>& fine_size(const Scene& scene) {
  return scene.settings.common.remesh->min_size;
}

/// The size that a front wants at a distance from it [m].
Real size_at(Real distance, Real fine, Real gradation) {
  return fine + std::log(gradation) * std::max(0.0, std::abs(distance) - front_band * fine);
}

/// Mean gradient of a level set at the nodes, [node][D], of length 1 or 0.
template <int D>
std::vector<Real> front_normals(const Mesh& mesh, std::span<const Real> level_set) {
  std::vector<Real> normals(static_cast<std::size_t>(mesh.nodes()) * D, 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto p1 = p1_gradients<D>(simplex_points<D>(mesh, e));
    Point<D> gradient = Point<D>::Zero();
    const auto nodes = mesh.nodes_of_element(e);
    for (int k = 0; k <= D; ++k)
      gradient += level_set[static_cast<std::size_t>(nodes[static_cast<std::size_t>(k)])] * p1.gradients.col(k);
    for (const LocalId node : nodes) {
      for (int c = 0; c < D; ++c)
        normals[static_cast<std::size_t>(node) * D + static_cast<std::size_t>(c)] += std::abs(p1.volume) * gradient[c];
    }
  }
  mesh.node_halo.add_to_owners(std::span(normals), D);
  mesh.node_halo.update_copies(std::span(normals), D);
  for (std::size_t node = 0; node < static_cast<std::size_t>(mesh.nodes()); ++node) {
    Eigen::Map<Point<D>> normal(normals.data() + node * D);
    const Real length = normal.norm();
    if (length > 0) normal /= length;
  }
  return normals;
}

/// Tensors with the front's size across it and the metric's own sizes along it.
template <int D>
Metric across_front(const Mesh& mesh, std::span<const Real> level_set, const Metric& sizes, Real fine, Real gradation) {
  const std::vector<Real> normals = front_normals<D>(mesh, level_set);
  std::vector<Real> tensors;
  for (std::size_t node = 0; node < level_set.size(); ++node) {
    const Real along = sizes.values()[sizes.kind() == Metric::Kind::uniform ? 0 : node];
    const Real across = std::min(along, size_at(level_set[node], fine, gradation));
    const Real* normal = normals.data() + node * D;
    for (int i = 0; i < D; ++i) {
      for (int j = 0; j <= i; ++j) {
        const Real along_part = i == j ? 1 / (along * along) : 0;
        tensors.push_back(along_part + (1 / (across * across) - 1 / (along * along)) * normal[i] * normal[j]);
      }
    }
  }
  return Metric::tensors(D, std::move(tensors));
}

}  // namespace

void refine_at_fronts(const Scene& scene, const FrontSet& fronts, Metric& metric) {
  if (!fine_size(scene)) return;
  const Real fine = *fine_size(scene);
  const Real gradation = scene.settings.common.remesh->gradation;
  const bool stretched = scene.settings.common.remesh->anisotropic && metric.kind() != Metric::Kind::tensors;
  RemeshMesh nodes;  // for their count alone
  nodes.dimension = scene.mesh.dim;
  nodes.coordinates = scene.mesh.coordinates;
  const Metric base = metric;
  for (std::size_t i = 0; i < fronts.size(); ++i) {
    const std::span<const Real> level_set = fronts.values(i);
    if (stretched) {
      const Metric tensors = scene.mesh.dim == 2 ? across_front<2>(scene.mesh, level_set, base, fine, gradation)
                                                 : across_front<3>(scene.mesh, level_set, base, fine, gradation);
      metric = i == 0 ? tensors : intersect(nodes, metric, tensors);
      continue;
    }
    std::vector<Real> sizes(level_set.size());
    std::transform(level_set.begin(), level_set.end(), sizes.begin(),
                   [&](Real distance) { return size_at(distance, fine, gradation); });
    metric = intersect(nodes, metric, Metric::per_node(std::move(sizes)));
  }
}

bool front_left_fine_elements(const Scene& scene, const FrontSet& fronts) {
  if (!fine_size(scene)) return false;
  const Mesh& mesh = scene.mesh;
  std::array<GlobalId, 2> cut = {0, 0};  // edges: all, those that are too long
  for (std::size_t i = 0; i < fronts.size(); ++i) {
    const std::span<const Real> level_set = fronts.values(i);
    const auto value = [&](LocalId node) { return level_set[static_cast<std::size_t>(node)]; };
    const auto count_edge = [&](LocalId a, LocalId b) {
      if (!(value(a) > 0 && value(b) < 0)) return;
      // Along the front an edge may be long: what counts is its part across.
      ++cut[0];
      cut[1] += value(a) - value(b) > tolerated_size * *fine_size(scene) ? 1 : 0;
    };
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto nodes = mesh.nodes_of_element(e);
      for (const LocalId a : nodes) std::for_each(nodes.begin(), nodes.end(), [&](LocalId b) { count_edge(a, b); });
    }
  }
  scene.comm.sum_in_place(cut);
  return static_cast<Real>(cut[1]) > tolerated_share * static_cast<Real>(cut[0]);
}

}  // namespace malleus::inject
