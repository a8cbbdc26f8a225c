#include "remesh/interface_strip.hpp"

#include <algorithm>

#include "base/index.hpp"

namespace malleus {
namespace {

/// The largest of the holders' values at each node.
void level_largest(const Mesh& mesh, std::vector<Real>& values) {
  mesh.node_halo.max_to_owners(std::span(values), 1);
  mesh.node_halo.update_copies(std::span(values), 1);
}

Real largest_at(const Mesh& mesh, LocalId element, const std::vector<Real>& values) {
  Real largest = 0;
  for (const LocalId node : mesh.nodes_of_element(element)) largest = std::max(largest, values[index(node)]);
  return largest;
}

}  // namespace

std::vector<int> layers_from(const Communicator& /*the halo knows it*/, const Mesh& mesh,
                             const std::vector<std::uint8_t>& marks, int layers) {
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

}  // namespace malleus
