#include "fem/pressure_extension.hpp"

#include <vector>

namespace malleus {
namespace {

constexpr int most_layers = 64;

std::vector<Real> modelled_nodes(const Mesh& mesh, std::span<const Real> element_viscosity) {
  std::vector<Real> is_known(static_cast<std::size_t>(mesh.nodes()), 0.0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    if (!(element_viscosity[static_cast<std::size_t>(e)] > 0)) continue;
    for (const LocalId node : mesh.nodes_of_element(e)) is_known[static_cast<std::size_t>(node)] = 1;
  }
  mesh.node_halo.max_to_owners(is_known, 1);
  mesh.node_halo.update_copies(is_known, 1);
  return is_known;
}

/// Sums of the known pressures of neighbours and their number, [node][2].
std::vector<Real> sums_of_neighbours(const Mesh& mesh, std::span<const Real> is_known, std::span<const Real> pressure) {
  std::vector<Real> sums(is_known.size() * 2, 0.0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    Real sum = 0;
    Real count = 0;
    for (const LocalId node : nodes) {
      if (is_known[static_cast<std::size_t>(node)] == 0) continue;
      sum += pressure[static_cast<std::size_t>(node)];
      count += 1;
    }
    for (const LocalId node : nodes) {
      sums[static_cast<std::size_t>(node) * 2] += sum;
      sums[static_cast<std::size_t>(node) * 2 + 1] += count;
    }
  }
  mesh.node_halo.add_to_owners(sums, 2);
  mesh.node_halo.update_copies(sums, 2);
  return sums;
}

}  // namespace

void extend_pressure(const Communicator& comm, const Mesh& mesh, std::span<const Real> element_viscosity,
                     std::span<Real> pressure) {
  std::vector<Real> is_known = modelled_nodes(mesh, element_viscosity);
  for (int layer = 0; layer < most_layers; ++layer) {
    bool any_unknown = false;
    for (const Real known : is_known) any_unknown = any_unknown || known == 0;
    if (!comm.any(any_unknown)) return;
    const std::vector<Real> sums = sums_of_neighbours(mesh, is_known, pressure);
    for (std::size_t node = 0; node < is_known.size(); ++node) {
      if (is_known[node] > 0 || sums[2 * node + 1] == 0) continue;
      pressure[node] = sums[2 * node] / sums[2 * node + 1];
      is_known[node] = 1;
    }
  }
}

}  // namespace malleus
