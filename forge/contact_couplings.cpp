#include "forge/contact_couplings.hpp"

namespace malleus::forge {

std::vector<NodeCoupling> couple_pairs(const Mesh& mesh, std::span<const NodeFacetPair> pairs) {
  std::vector<NodeCoupling> couplings;
  for (const NodeFacetPair& pair : pairs) {
    for (const GlobalId master : pair.masters) {
      if (master >= 0) couplings.push_back({mesh.global_node(pair.slave), master, contact_coupling});
    }
  }
  return couplings;
}

std::vector<NodeCoupling> contact_couplings(const Scene& scene) {
  if (scene.pairs.empty()) return {};
  const FreeSurface surface(*scene.comm, scene.mesh, scene.geometry, scene.boundaries->is_free());
  std::vector<Vector> positions;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node)
    positions.push_back(to_vector(scene.mesh.point(node), scene.dim()));
  std::vector<NodeCoupling> couplings;
  for (const BodyPair& pair : scene.pairs) {
    const Real edge = scene.body_scales[static_cast<std::size_t>(pair.slave)].edge;
    const std::vector<NodeFacetPair> met = find_pairs(*scene.comm, surface, positions, {pair.slave, pair.master, edge});
    const std::vector<NodeCoupling> more = couple_pairs(scene.mesh, met);
    couplings.insert(couplings.end(), more.begin(), more.end());
  }
  return couplings;
}

}  // namespace malleus::forge
