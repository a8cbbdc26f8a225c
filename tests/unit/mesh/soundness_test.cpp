#include "mesh/soundness.hpp"

#include <gtest/gtest.h>

#include <map>

#include "support/box_chunk.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_chunk;
using test::renumbered;
using test::small_box;
using test::world;

/// kind -> count.
using Counts = std::map<std::string, GlobalId>;

Counts problems_of(MeshChunk chunk) {
  Counts counts;
  for (const MeshProblem& problem : find_problems(world(), distribute_mesh(world(), std::move(chunk)))) {
    counts[problem.kind] = problem.count;
  }
  // The test box has inverted elements, and nodes that two ranks give: told apart by tests of their own.
  counts.erase("inverted elements");
  counts.erase("repeated nodes");
  return counts;
}

/// Adds to the chunk, on the root, a simplex on new nodes; region 0.
void add_simplex(MeshChunk& chunk, GlobalId first_number, const std::vector<std::vector<Real>>& points, GlobalId id) {
  if (!world().is_root()) return;
  for (const std::vector<Real>& point : points) {
    chunk.element_nodes.push_back(first_number);
    chunk.node_numbers.push_back(first_number++);
    chunk.coordinates.insert(chunk.coordinates.end(), point.begin(), point.end());
  }
  chunk.element_region.push_back(0);
  chunk.element_ids.push_back(id);
}

class Soundness : public testing::TestWithParam<int> {};

TEST_P(Soundness, ASoundMeshHasNoProblem) {
  EXPECT_EQ(problems_of(box_chunk(small_box(GetParam()))), Counts{});
}

/// A corner of one element carried through its opposite face and beyond: no order of nodes can mend that.
TEST_P(Soundness, FoldsAreCounted) {
  MeshChunk chunk = box_chunk(small_box(GetParam()));
  const auto dim = static_cast<std::size_t>(chunk.dim);
  // Nodes off the lower faces go to the other side of the plane x = 0.
  for (std::size_t node = 0; node < chunk.node_numbers.size(); ++node) {
    bool is_inside = true;
    for (std::size_t c = 0; c < dim; ++c) {
      is_inside = is_inside && chunk.coordinates[node * dim + c] > 1e-9;
    }
    if (is_inside) chunk.coordinates[node * dim] = -chunk.coordinates[node * dim];
  }
  EXPECT_GT(problems_of(std::move(chunk))["folds"], 0);
}

TEST_P(Soundness, UntaggedBoundaryIsCounted) {
  MeshChunk chunk = box_chunk(small_box(GetParam()));
  chunk.facet_nodes.clear();
  chunk.facet_group.clear();
  EXPECT_EQ(problems_of(std::move(chunk)), (Counts{{"untagged boundary", GetParam() == 3 ? 188 : 18}}));
}

TEST_P(Soundness, UnusedNodesAreCounted) {
  MeshChunk chunk = box_chunk(small_box(GetParam()));
  chunk.node_numbers.push_back(10000000000 + world().rank());
  chunk.coordinates.insert(chunk.coordinates.end(), static_cast<std::size_t>(chunk.dim), 0.01);
  EXPECT_EQ(problems_of(std::move(chunk)), (Counts{{"unused nodes", world().size()}}));
}

TEST_P(Soundness, InvertedElementsAndRepeatedNodesAreCounted) {
  const int dim = GetParam();
  MeshChunk chunk;
  chunk.dim = dim;
  chunk.region_names = {"one"};
  std::vector<std::vector<Real>> corners(static_cast<std::size_t>(dim) + 1,
                                         std::vector<Real>(static_cast<std::size_t>(dim), 0.0));
  for (std::size_t k = 0; k < static_cast<std::size_t>(dim); ++k) corners[k + 1][k] = 1;
  std::swap(corners[0], corners[1]);
  add_simplex(chunk, 7, corners, 0);
  if (world().rank() == world().size() - 1) {
    chunk.node_numbers.push_back(7);
    chunk.coordinates.insert(chunk.coordinates.end(), corners[0].begin(), corners[0].end());
  }
  Counts counts;
  for (const MeshProblem& problem : find_problems(world(), distribute_mesh(world(), chunk))) {
    counts[problem.kind] = problem.count;
  }
  EXPECT_EQ(counts, (Counts{{"inverted elements", 1}, {"repeated nodes", 1}, {"untagged boundary", dim + 1}}));
}

TEST_P(Soundness, ACopyOfABodyInTheSameRegionCoincides) {
  const int dim = GetParam();
  MeshChunk chunk = box_chunk(small_box(dim));
  const MeshChunk original = chunk;
  const GlobalId shift = 1 << 30;
  for (const GlobalId number : original.node_numbers) chunk.node_numbers.push_back(number + shift);
  chunk.coordinates.insert(chunk.coordinates.end(), original.coordinates.begin(), original.coordinates.end());
  for (const GlobalId number : original.element_nodes) chunk.element_nodes.push_back(number + shift);
  for (const GlobalId number : original.facet_nodes) chunk.facet_nodes.push_back(number + shift);
  chunk.facet_group.insert(chunk.facet_group.end(), original.facet_group.begin(), original.facet_group.end());
  for (const GlobalId id : original.element_ids) chunk.element_ids.push_back(id + shift);
  chunk.region_names.push_back("second");
  chunk.element_region.insert(chunk.element_region.end(), original.element_region.size(), 1);
  // Bodies may touch: nodes of different regions do not coincide.
  EXPECT_EQ(problems_of(chunk), Counts{});
  for (std::int32_t& region : chunk.element_region) region = 0;
  EXPECT_EQ(problems_of(chunk), (Counts{{"coincident nodes", dim == 3 ? 6 * 5 * 4 : 6 * 5}}));
}

TEST_P(Soundness, AHangingNodeIsFoundOnEdgesAndFaces) {
  const int dim = GetParam();
  // Beside the box's face x = 1, a simplex whose corner lies in the middle of a face of an element.
  MeshChunk chunk = box_chunk(small_box(dim));
  const Real y = 1.0 / 12;
  const Real z = 1.0 / 9;
  if (dim == 3) add_simplex(chunk, 5000000, {{1, y, z}, {2, 0, 0}, {2, 1, 0}, {2, 0, 1}}, 9999);
  if (dim == 2) add_simplex(chunk, 5000000, {{1, y}, {2, 0}, {2, 1}}, 9999);
  const Counts counts = problems_of(std::move(chunk));
  EXPECT_EQ(counts.at("hanging nodes"), 1);
  EXPECT_EQ(counts.count("coincident nodes"), 0U);
}

TEST_P(Soundness, FlatElementsAreFound) {
  const int dim = GetParam();
  MeshChunk chunk = box_chunk(small_box(dim));
  if (dim == 3) add_simplex(chunk, 5000000, {{3, 0, 0}, {4, 0, 0}, {3, 1, 0}, {4, 1, 0}}, 9999);
  if (dim == 2) add_simplex(chunk, 5000000, {{3, 0}, {4, 0}, {5, 0}}, 9999);
  EXPECT_EQ(problems_of(std::move(chunk)).at("flat elements"), 1);
}

TEST_P(Soundness, ThreeElementsAtAFaceAreNotManifold) {
  const int dim = GetParam();
  MeshChunk chunk = box_chunk(small_box(dim));
  // Elements of the first element's first dim nodes and a new node, on both sides of what is there.
  std::vector<GlobalId> face(
      chunk.element_nodes.begin(),
      chunk.element_nodes.begin() + std::min<std::ptrdiff_t>(dim, std::ssize(chunk.element_nodes)));
  const GlobalId holder = world().min(face.empty() ? GlobalId{1000} : static_cast<GlobalId>(world().rank()));
  if (world().rank() == holder) {
    for (GlobalId extra = 0; extra < 2; ++extra) {
      chunk.node_numbers.push_back(6000000 + extra);
      for (int c = 0; c < dim; ++c) chunk.coordinates.push_back(7.0 + 0.3 * c + static_cast<Real>(extra));
      chunk.element_nodes.insert(chunk.element_nodes.end(), face.begin(), face.end());
      chunk.element_nodes.push_back(6000000 + extra);
      chunk.element_region.push_back(0);
      chunk.element_ids.push_back(9990 + extra);
    }
  }
  EXPECT_EQ(problems_of(std::move(chunk)).at("crowded faces"), 1);
}

TEST(SoundnessOfEdges, TwoBodiesThatShareAnEdgeHaveABranchingBoundary) {
  MeshChunk chunk = box_chunk(small_box(3));
  // A tetrahedron outside that shares the box's edge from node (5, 0, 0) to (5, 0, 1) alone.
  if (world().is_root()) {
    chunk.element_nodes.insert(chunk.element_nodes.end(), {renumbered(5), renumbered(35), 6000000, 6000001});
    chunk.node_numbers.insert(chunk.node_numbers.end(), {6000000, 6000001});
    chunk.coordinates.insert(chunk.coordinates.end(), {2, -1, 0, 2, -2, 1});
    chunk.element_region.push_back(0);
    chunk.element_ids.push_back(9999);
  }
  EXPECT_EQ(problems_of(std::move(chunk)).at("branching boundary"), 1);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Soundness, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
