#include "fem/pressure_extension.hpp"

#include <algorithm>
#include <vector>

namespace malleus {
namespace {

constexpr int most_layers = 64;

/// f . (x_to - x_from), Pa.
Real head(const Mesh& mesh, std::span<const Real> element_force, LocalId element, LocalId from, LocalId to) {
  if (element_force.empty()) return 0;
  const Real* force = element_force.data() + static_cast<std::size_t>(element) * static_cast<std::size_t>(mesh.dim);
  Real sum = 0;
  for (int c = 0; c < mesh.dim; ++c) sum += force[c] * (mesh.point(to)[c] - mesh.point(from)[c]);
  return sum;
}

/// Sums of the pressures that known neighbours tell, and their number, [node][2].
std::vector<Real> sums_of_neighbours(const Mesh& mesh, std::span<const char> is_known,
                                     std::span<const Real> element_force, std::span<const Real> pressure) {
  std::vector<Real> sums(is_known.size() * 2, 0.0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (const LocalId from : nodes) {
      if (is_known[static_cast<std::size_t>(from)] == 0) continue;
      for (const LocalId to : nodes) {
        Real* sum = sums.data() + static_cast<std::size_t>(to) * 2;
        sum[0] += pressure[static_cast<std::size_t>(from)] + head(mesh, element_force, e, from, to);
        sum[1] += 1;
      }
    }
  }
  mesh.node_halo.add_to_owners(sums, 2);
  mesh.node_halo.update_copies(sums, 2);
  return sums;
}

}  // namespace

std::vector<char> modelled_nodes(const Mesh& mesh, std::span<const Real> element_viscosity) {
  std::vector<Real> touches(static_cast<std::size_t>(mesh.nodes()), 0.0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    if (!(element_viscosity[static_cast<std::size_t>(e)] > 0)) continue;
    for (const LocalId node : mesh.nodes_of_element(e)) touches[static_cast<std::size_t>(node)] = 1;
  }
  mesh.node_halo.max_to_owners(touches, 1);
  mesh.node_halo.update_copies(touches, 1);
  std::vector<char> result(touches.size());
  std::transform(touches.begin(), touches.end(), result.begin(), [](Real t) { return t > 0 ? 1 : 0; });
  return result;
}

void extend_pressure(const Communicator& comm, const Mesh& mesh, std::span<const Real> element_viscosity,
                     std::span<const Real> element_force, std::span<Real> pressure) {
  std::vector<char> is_known = modelled_nodes(mesh, element_viscosity);
  for (int layer = 0; layer < most_layers; ++layer) {
    bool any_unknown = false;
    for (const char known : is_known) any_unknown = any_unknown || known == 0;
    if (!comm.any(any_unknown)) return;
    const std::vector<Real> sums = sums_of_neighbours(mesh, is_known, element_force, pressure);
    for (std::size_t node = 0; node < is_known.size(); ++node) {
      if (is_known[node] != 0 || sums[2 * node + 1] == 0) continue;
      pressure[node] = sums[2 * node] / sums[2 * node + 1];
      is_known[node] = 1;
    }
  }
}

}  // namespace malleus
