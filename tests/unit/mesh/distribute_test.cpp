#include "mesh/distribute.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "mesh/curve_partition.hpp"
#include "mesh/number_table.hpp"
#include "mesh/simplex.hpp"
#include "parallel/sparse_exchange.hpp"
#include "support/box_chunk.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_chunk;
using test::box_mesh;
using test::BoxMeshOptions;
using test::renumbered;
using test::small_box;
using test::world;

/// Moves everything that the ranks read to one of them.
MeshChunk all_on_rank(const BoxMeshOptions& options, int rank) {
  MeshChunk chunk = box_chunk(options);
  const auto move_to_rank = [&](auto& list) {
    using T = typename std::remove_reference_t<decltype(list)>::value_type;
    const std::map<int, std::vector<T>> sent = {{rank, list}};
    list.clear();
    for (const auto& [from, values] : sparse_exchange(world(), sent)) {
      list.insert(list.end(), values.begin(), values.end());
    }
  };
  move_to_rank(chunk.node_numbers);
  move_to_rank(chunk.coordinates);
  move_to_rank(chunk.element_nodes);
  move_to_rank(chunk.element_region);
  move_to_rank(chunk.element_ids);
  move_to_rank(chunk.facet_nodes);
  move_to_rank(chunk.facet_group);
  return chunk;
}

Real total_volume(const Mesh& mesh) {
  Real volume = 0;
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) volume += simplex_volume<D>(simplex_points<D>(mesh, e));
  });
  return world().sum(volume);
}

class DistributedBox : public testing::TestWithParam<int> {};

TEST_P(DistributedBox, IsTheBoxThatWasGiven) {
  const Mesh mesh = build_mesh(world(), box_chunk(small_box(GetParam())));
  const Mesh expected = box_mesh(world(), small_box(GetParam()));
  EXPECT_EQ(mesh.total_nodes(), expected.total_nodes());
  EXPECT_EQ(mesh.total_elements, expected.total_elements);
  EXPECT_EQ(mesh.group_names, expected.group_names);
  EXPECT_EQ(world().sum(GlobalId{mesh.exterior_facets}), world().sum(GlobalId{expected.exterior_facets}));
  EXPECT_EQ(world().sum(GlobalId{mesh.facets()}), world().sum(GlobalId{expected.facets()}));
  EXPECT_NEAR(total_volume(mesh), 1.0, 1e-14);
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    const std::int32_t group = mesh.facet_group[static_cast<std::size_t>(f)];
    ASSERT_GE(group, 0);
    for (const LocalId node : mesh.nodes_of_facet(f)) EXPECT_EQ(mesh.point(node)[group / 2], group % 2);
  }
}

TEST_P(DistributedBox, LoadsAreEqualWhereverTheChunksWere) {
  const Mesh mesh = build_mesh(world(), all_on_rank(small_box(GetParam()), world().size() - 1));
  const GlobalId fair = mesh.total_elements / world().size();
  EXPECT_LE(std::abs(mesh.elements() - fair), 8);
}

TEST_P(DistributedBox, TheDivisionDoesNotDependOnWhoReadWhat) {
  const DistributedPiece a = distribute_mesh(world(), box_chunk(small_box(GetParam())));
  const DistributedPiece b = distribute_mesh(world(), all_on_rank(small_box(GetParam()), 0));
  std::vector<GlobalId> ids_a = a.piece.element_ids;
  std::vector<GlobalId> ids_b = b.piece.element_ids;
  std::sort(ids_a.begin(), ids_a.end());
  std::sort(ids_b.begin(), ids_b.end());
  EXPECT_EQ(ids_a, ids_b);
}

TEST_P(DistributedBox, RepeatsTheSameBytes) {
  const DistributedPiece a = distribute_mesh(world(), box_chunk(small_box(GetParam())));
  const DistributedPiece b = distribute_mesh(world(), box_chunk(small_box(GetParam())));
  EXPECT_EQ(a.piece.node_numbers, b.piece.node_numbers);
  EXPECT_EQ(a.piece.element_nodes, b.piece.element_nodes);
  EXPECT_EQ(a.piece.facet_nodes, b.piece.facet_nodes);
  EXPECT_EQ(a.piece.coordinates, b.piece.coordinates);
}

TEST_P(DistributedBox, WeightsAreBalanced) {
  MeshChunk chunk = box_chunk(small_box(GetParam()));
  GlobalId total = 0;
  for (const GlobalId id : chunk.element_ids) {
    chunk.element_weights.push_back(id % 5 + 1);
    total += id % 5 + 1;
  }
  total = world().sum(total);
  const DistributedPiece distributed = distribute_mesh(world(), std::move(chunk));
  GlobalId mine = 0;
  for (const GlobalId id : distributed.piece.element_ids) mine += id % 5 + 1;
  EXPECT_LE(std::abs(mine - total / world().size()), 24);
}

TEST_P(DistributedBox, RepeatsAndLooseEndsAreCountedAndLeftOut) {
  MeshChunk chunk = box_chunk(small_box(GetParam()));
  const GlobalId elements = world().sum(static_cast<GlobalId>(chunk.element_region.size()));
  const GlobalId facets = world().sum(static_cast<GlobalId>(chunk.facet_group.size()));
  const auto dim = static_cast<std::ptrdiff_t>(chunk.dim);
  const bool has_elements = !chunk.element_region.empty();
  if (has_elements) {
    const std::vector<GlobalId> first(chunk.element_nodes.begin(), chunk.element_nodes.begin() + dim + 1);
    chunk.element_nodes.insert(chunk.element_nodes.end(), first.rbegin(), first.rend());
    chunk.element_region.push_back(0);
    chunk.element_ids.push_back(elements + world().rank());
    const std::vector<GlobalId> facet(chunk.facet_nodes.begin(), chunk.facet_nodes.begin() + dim);
    chunk.facet_nodes.insert(chunk.facet_nodes.end(), facet.rbegin(), facet.rend());
    chunk.facet_group.push_back(chunk.facet_group.front() == 1 ? 0 : 1);
  }
  if (world().is_root()) {
    chunk.node_numbers.push_back(999999999999);
    chunk.coordinates.insert(chunk.coordinates.end(), static_cast<std::size_t>(dim), 0.5);
    const std::vector<GlobalId> ends = {renumbered(0), renumbered(5), renumbered(23)};
    chunk.facet_nodes.insert(chunk.facet_nodes.end(), ends.begin(), ends.begin() + dim);
    chunk.facet_group.push_back(1);
  }
  const DistributedPiece distributed = distribute_mesh(world(), std::move(chunk));
  const GlobalId repeats = world().sum(GlobalId{has_elements});
  EXPECT_EQ(distributed.report.repeated_elements, repeats);
  EXPECT_EQ(distributed.report.repeated_facets, repeats);
  EXPECT_EQ(distributed.report.unused_nodes, 1);
  EXPECT_EQ(distributed.report.loose_facets[1], 1);
  EXPECT_EQ(
      std::accumulate(distributed.report.loose_facets.begin(), distributed.report.loose_facets.end(), GlobalId{0}), 1);
  for (const GlobalId id : distributed.piece.element_ids) EXPECT_LT(id, elements);
  const Mesh mesh = assemble_mesh(world(), distributed.piece).mesh;
  EXPECT_EQ(mesh.total_elements, elements);
  EXPECT_EQ(world().sum(GlobalId{mesh.exterior_facets}), facets);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, DistributedBox, testing::Values(2, 3));

std::string message_of(MeshChunk chunk) {
  try {
    build_mesh(world(), std::move(chunk));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::wrong_input);
    return error.what();
  }
  return "no error";
}

TEST(Distribution, AnUnknownNodeIsRefusedOnAllRanks) {
  MeshChunk chunk = all_on_rank(small_box(3), 0);
  if (world().is_root()) chunk.element_nodes[5] = 123456789012345;
  EXPECT_EQ(message_of(std::move(chunk)), "box: an element uses node 123456789012345, which is not given");
}

TEST(Distribution, ANodeAtTwoPlacesIsRefused) {
  MeshChunk chunk = box_chunk(small_box(3));
  chunk.node_numbers.push_back(renumbered(3));
  chunk.coordinates.insert(chunk.coordinates.end(), {0.1, 0.2, static_cast<Real>(world().rank())});
  EXPECT_EQ(message_of(std::move(chunk)), "box: node 26 is given twice, at two places");
}

TEST(Distribution, AnElementWithANodeTwiceIsRefused) {
  MeshChunk chunk = all_on_rank(small_box(2), 0);
  if (world().is_root()) chunk.element_nodes[1] = chunk.element_nodes[2];
  EXPECT_NE(message_of(std::move(chunk)).find("twice"), std::string::npos);
}

TEST(Distribution, ALooseFacetIsRefusedByName) {
  MeshChunk chunk = box_chunk(small_box(3));
  if (world().is_root()) {
    chunk.facet_nodes.insert(chunk.facet_nodes.end(), {renumbered(0), renumbered(5), renumbered(23)});
    chunk.facet_group.push_back(2);
  }
  EXPECT_EQ(message_of(std::move(chunk)), "box: 1 triangles of group 'y_low' are no face of a tetrahedron of the mesh");
}

TEST(Distribution, AnEmptyMeshIsLegal) {
  MeshChunk chunk;
  chunk.region_names = {"nothing"};
  const Mesh mesh = build_mesh(world(), std::move(chunk));
  EXPECT_EQ(mesh.total_elements, 0);
  EXPECT_EQ(mesh.total_nodes(), 0);
}

TEST(CurvePartition, EqualKeysStayTogetherAndOthersAreSplitEvenly) {
  std::vector<std::uint64_t> keys(10, 42);
  for (const int rank : curve_partition(world(), keys, {})) {
    EXPECT_EQ(rank, curve_partition(world(), keys, {}).front());
  }
  std::vector<std::uint64_t> spread;
  for (std::uint64_t i = 0; i < 100; ++i)
    spread.push_back((i * 100 + static_cast<std::uint64_t>(world().rank())) << 40);
  std::vector<GlobalId> counts(static_cast<std::size_t>(world().size()), 0);
  for (const int rank : curve_partition(world(), spread, {})) ++counts[static_cast<std::size_t>(rank)];
  world().sum_in_place(std::span(counts));
  for (const GlobalId count : counts) EXPECT_EQ(count, 100);
}

TEST(NumberTable, FindsWhatWasInsertedForAnyPattern) {
  for (const GlobalId stride : {GlobalId{1}, GlobalId{3}, GlobalId{1} << 20, GlobalId{1} << 40}) {
    NumberTable table;
    for (GlobalId i = 0; i < 3000; ++i) EXPECT_EQ(table.insert(i * stride + 5), static_cast<LocalId>(i));
    for (GlobalId i = 0; i < 3000; ++i) EXPECT_EQ(table.find(i * stride + 5), static_cast<LocalId>(i));
    EXPECT_EQ(table.insert(5), 0);
    EXPECT_EQ(table.find(4), -1);
    EXPECT_EQ(table.size(), 3000);
  }
}

}  // namespace
}  // namespace malleus
