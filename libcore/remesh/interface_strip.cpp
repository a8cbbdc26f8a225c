#include "remesh/interface_strip.hpp"

#include <algorithm>

#include "base/index.hpp"

namespace malleus {
namespace {

Real largest_at(const Mesh& mesh, LocalId element, const std::vector<Real>& values) {
  Real largest = 0;
  for (const LocalId node : mesh.nodes_of_element(element)) largest = std::max(largest, values[index(node)]);
  return largest;
}

}  // namespace

void level_largest(const Mesh& mesh, std::vector<Real>& values) {
  mesh.node_halo.max_to_owners(std::span(values), 1);
  mesh.node_halo.update_copies(std::span(values), 1);
}

void level_largest(const Mesh& mesh, std::vector<std::uint8_t>& values) {
  std::vector<Real> levelled(values.begin(), values.end());
  level_largest(mesh, levelled);
  std::transform(levelled.begin(), levelled.end(), values.begin(), [](Real v) { return static_cast<std::uint8_t>(v); });
}

std::vector<int> layers_from(const Mesh& mesh, const std::vector<std::uint8_t>& marks, int layers) {
  // Nearness, layers + 1 at the marks and 0 beyond, grows by the maximum.
  std::vector<Real> nearness(index(mesh.nodes()), 0);
  for (std::size_t node = 0; node < marks.size(); ++node) nearness[node] = marks[node] != 0 ? layers + 1 : 0;
  level_largest(mesh, nearness);
  for (int layer = layers; layer > 0; --layer) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (largest_at(mesh, e, nearness) != layer + 1) continue;
      for (const LocalId node : mesh.nodes_of_element(e))
        nearness[index(node)] = std::max<Real>(nearness[index(node)], layer);
    }
    level_largest(mesh, nearness);
  }
  std::vector<int> distance(nearness.size());
  std::transform(nearness.begin(), nearness.end(), distance.begin(),
                 [&](Real near) { return layers + 1 - static_cast<int>(near); });
  return distance;
}

std::vector<Real> centroids(const Mesh& mesh) {
  const auto dim = static_cast<std::size_t>(mesh.dim);
  std::vector<Real> result(index(mesh.elements()) * dim, 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e)) {
      for (std::size_t i = 0; i < dim; ++i) result[index(e) * dim + i] += mesh.point(node)[i] / (mesh.dim + 1);
    }
  }
  return result;
}

std::vector<std::uint8_t> elements_at(const Mesh& mesh, const PlaneCuts& cuts, int layers) {
  std::vector<int> part;
  for (LocalId node = 0; node < mesh.nodes(); ++node) part.push_back(cuts.part_of(mesh.point(node)));
  std::vector<std::uint8_t> marks(part.size(), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    const int first = part[index(nodes[0])];
    if (std::all_of(nodes.begin(), nodes.end(), [&](LocalId node) { return part[index(node)] == first; })) continue;
    for (const LocalId node : nodes) marks[index(node)] = 1;
  }
  const std::vector<int> distance = layers_from(mesh, marks, layers);
  std::vector<std::uint8_t> selected(index(mesh.elements()), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    selected[index(e)] =
        std::any_of(nodes.begin(), nodes.end(), [&](LocalId node) { return distance[index(node)] < layers; }) ? 1 : 0;
  }
  return selected;
}

}  // namespace malleus
