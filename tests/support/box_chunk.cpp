#include "support/box_chunk.hpp"

#include <algorithm>
#include <numeric>
#include <random>

#include "support/world.hpp"

namespace malleus::test {

BoxMeshOptions small_box(int dim) {
  BoxMeshOptions box;
  box.dim = dim;
  box.cells = {5, 4, 3};
  return box;
}

GlobalId renumbered(GlobalId number) {
  return 17 + number * 3 + number / 7 * 1000000;
}

MeshChunk box_chunk(const BoxMeshOptions& options) {
  const MeshPiece piece = box_piece(world(), options);
  MeshChunk chunk;
  chunk.source = "box";
  chunk.dim = piece.dim;
  chunk.region_names = piece.region_names;
  chunk.group_names = piece.group_names;
  chunk.coordinates = piece.coordinates;
  for (const GlobalId number : piece.node_numbers) chunk.node_numbers.push_back(renumbered(number));
  const auto number_of = [&](LocalId node) { return chunk.node_numbers[static_cast<std::size_t>(node)]; };
  std::vector<LocalId> order(static_cast<std::size_t>(piece.elements()));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(5));
  const GlobalId first = world().sum_of_lower_ranks(piece.elements());
  for (const LocalId e : order) {
    for (int i = 0; i <= piece.dim; ++i) {
      const auto slot = static_cast<std::size_t>(e * (piece.dim + 1) + i);
      chunk.element_nodes.push_back(number_of(piece.element_nodes[slot]));
    }
    chunk.element_region.push_back(piece.element_region[static_cast<std::size_t>(e)]);
    chunk.element_ids.push_back(first + e);
  }
  for (const LocalId node : piece.facet_nodes) chunk.facet_nodes.push_back(number_of(node));
  chunk.facet_group = piece.facet_group;
  return chunk;
}

}  // namespace malleus::test
