#include "support/mesh_checksum.hpp"

#include <bit>

#include "support/world.hpp"

namespace malleus::test {
namespace {

constexpr int headroom = 24;  ///< bits by which entries are shortened, so that sums do not overflow

std::uint64_t mixed(std::uint64_t value) {
  value ^= value >> 31;
  value *= 0x9E3779B97F4A7C15ULL;
  return value ^ (value >> 29);
}

std::uint64_t checksum_of_name(const std::string& name) {
  std::uint64_t sum = 1;
  for (const char c : name) sum = mixed(sum + static_cast<unsigned char>(c));
  return sum;
}

std::uint64_t sum_of_points(const Mesh& mesh, std::span<const LocalId> nodes) {
  std::uint64_t sum = 0;
  for (const LocalId node : nodes) sum += checksum_of_point(mesh.point(node), mesh.dim);
  return sum;
}

}  // namespace

std::uint64_t checksum_of_point(const Real* point, int dim) {
  std::uint64_t sum = 0;
  for (int c = 0; c < dim; ++c) sum = mixed(sum + std::bit_cast<std::uint64_t>(point[c] + 0.0));
  return sum;
}

std::uint64_t checksum_of_simplex(std::uint64_t sum) {
  return mixed(sum);
}

GlobalId checksum_of_nodes(const Mesh& mesh) {
  std::uint64_t sum = 0;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    sum += checksum_of_point(mesh.point(node), mesh.dim) >> headroom;
  }
  return world().sum(static_cast<GlobalId>(sum));
}

GlobalId checksum_of_elements(const Mesh& mesh) {
  std::uint64_t sum = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto region = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
    const std::uint64_t name = checksum_of_name(mesh.region_names[region]);
    sum += checksum_of_simplex(name + sum_of_points(mesh, mesh.nodes_of_element(e))) >> headroom;
  }
  return world().sum(static_cast<GlobalId>(sum));
}

GlobalId checksum_of_groups(const Mesh& mesh) {
  std::uint64_t sum = 0;
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    const std::int32_t group = mesh.facet_group[static_cast<std::size_t>(f)];
    if (group < 0) continue;
    const std::uint64_t name = checksum_of_name(mesh.group_names[static_cast<std::size_t>(group)]);
    sum += checksum_of_simplex(name + sum_of_points(mesh, mesh.nodes_of_facet(f))) >> headroom;
  }
  return world().sum(static_cast<GlobalId>(sum));
}

}  // namespace malleus::test
