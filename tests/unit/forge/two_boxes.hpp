#pragma once

#include <algorithm>

#include "forge/geometry.hpp"
#include "partition/migrate.hpp"
#include "support/box_mesh.hpp"

namespace malleus::forge::test {

/// Two boxes of one mesh that share no nodes: regions "lower" and "upper", groups as in box_mesh with a prefix
/// ("lower_z_low").
inline Mesh two_boxes(const Communicator& comm, const malleus::test::BoxMeshOptions& lower,
                      const malleus::test::BoxMeshOptions& upper) {
  MeshPiece both = malleus::test::box_piece(comm, lower);
  const MeshPiece two = malleus::test::box_piece(comm, upper);
  GlobalId last = -1;
  for (const GlobalId number : both.node_numbers) last = std::max(last, number);
  const GlobalId shift = comm.max(last) + 1;
  const LocalId first_node = both.nodes();
  const auto groups = static_cast<std::int32_t>(both.group_names.size());
  both.region_names = {"lower", "upper"};
  for (std::string& name : both.group_names) name = "lower_" + name;
  for (const std::string& name : two.group_names) both.group_names.push_back("upper_" + name);
  for (const GlobalId number : two.node_numbers) both.node_numbers.push_back(number + shift);
  both.coordinates.insert(both.coordinates.end(), two.coordinates.begin(), two.coordinates.end());
  for (const LocalId node : two.element_nodes) both.element_nodes.push_back(node + first_node);
  both.element_region.insert(both.element_region.end(), two.element_region.size(), 1);
  both.element_ids.clear();
  for (const LocalId node : two.facet_nodes) both.facet_nodes.push_back(node + first_node);
  for (const std::int32_t group : two.facet_group) both.facet_group.push_back(group + groups);
  return assemble_mesh(comm, both).mesh;
}

/// Partitions that a search must not care about.
enum class Layout { as_built, all_on_the_last, scattered };

inline void lay_out(const Communicator& comm, Mesh& mesh, Layout layout) {
  if (layout == Layout::as_built) return;
  std::vector<int> destinations;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const int scattered = static_cast<int>((e * 7919LL + 13 * comm.rank()) % 101) % comm.size();
    destinations.push_back(layout == Layout::scattered ? scattered : comm.size() - 1);
  }
  FieldStore fields;
  migrate(comm, mesh, fields, destinations);
}

inline std::vector<Vector> positions_of(const Mesh& mesh) {
  std::vector<Vector> positions;
  for (LocalId n = 0; n < mesh.nodes(); ++n) positions.push_back(to_vector(mesh.point(n), mesh.dim));
  return positions;
}

}  // namespace malleus::forge::test
