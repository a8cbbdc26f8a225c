#include "inject/thin_sections.hpp"

#include <algorithm>

#include "base/log.hpp"

namespace malleus::inject {
namespace {

using Marks = std::vector<Real>;  ///< [node] 0 or 1, alike on all holders

/// Marks the neighbours of the marked nodes too.
Marks dilated(const Mesh& mesh, const Marks& marks) {
  Marks grown = marks;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    const bool any =
        std::any_of(nodes.begin(), nodes.end(), [&](LocalId n) { return marks[static_cast<std::size_t>(n)] > 0; });
    if (!any) continue;
    for (const LocalId n : nodes) grown[static_cast<std::size_t>(n)] = 1;
  }
  mesh.node_halo.max_to_owners(grown, 1);
  mesh.node_halo.update_copies(grown, 1);
  return grown;
}

/// Volume of the elements none of whose nodes is marked.
Real unmarked_volume(const Scene& scene, const Marks& marks) {
  Real volume = 0;
  for (LocalId e = 0; e < scene.mesh.elements(); ++e) {
    const auto nodes = scene.mesh.nodes_of_element(e);
    const bool none =
        std::all_of(nodes.begin(), nodes.end(), [&](LocalId n) { return marks[static_cast<std::size_t>(n)] == 0; });
    if (none) volume += scene.measures[static_cast<std::size_t>(e)];
  }
  return scene.comm.sum(volume);
}

}  // namespace

ThinSections find_thin_sections(const Scene& scene) {
  const std::vector<char> sticks = sticking_walls(scene);
  const auto n = static_cast<std::size_t>(scene.mesh.nodes());
  Marks first_layer(n);  // off the walls
  Marks wall(n);
  for (std::size_t node = 0; node < n; ++node) {
    wall[node] = sticks[node];
    first_layer[node] = sticks[node] == 0 ? 1 : 0;
  }
  const Marks near_wall = dilated(scene.mesh, wall);
  Marks second_layer(n);
  for (std::size_t node = 0; node < n; ++node) second_layer[node] = near_wall[node] == 0 ? 1 : 0;
  // Elements in corners have all nodes on walls, in sections of any width: only what is far from the inner layers
  // counts.
  ThinSections thin;
  thin.below_two = unmarked_volume(scene, dilated(scene.mesh, first_layer)) / scene.cavity;
  const Marks around = dilated(scene.mesh, dilated(scene.mesh, second_layer));
  thin.below_four = unmarked_volume(scene, around) / scene.cavity;
  return thin;
}

void warn_of(const ThinSections& thin) {
  if (thin.below_two > 1e-3) {
    log::warning(
        "{:.2g} % of the cavity is one element thin between walls: nothing flows there, and nothing is claimed for "
        "it; refine the mesh to 4 elements across",
        100 * thin.below_two);
  }
  if (thin.below_four > 1e-2) {
    log::warning(
        "{:.2g} % of the cavity has fewer than 4 elements across: pressure drops there are 6 % (3 across) to 31 % (2 "
        "across) too high",
        100 * thin.below_four);
  }
}

}  // namespace malleus::inject
