#include "mesh/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

TEST(MeshStatistics, OfABoxOfCubesAreKnown) {
  test::BoxMeshOptions box;
  box.cells = {4, 3, 2};
  box.low = {1, 0, 0};
  box.high = {5, 3, 2};
  const MeshStatistics s = mesh_statistics(world(), box_mesh(world(), box));
  EXPECT_EQ(s.nodes, 60);
  EXPECT_EQ(s.elements, 144);
  EXPECT_EQ(s.exterior_facets, 104);
  EXPECT_EQ(s.unnamed_exterior_facets, 0);
  EXPECT_EQ(s.box.low, (std::array<Real, 3>{1, 0, 0}));
  EXPECT_EQ(s.box.high, (std::array<Real, 3>{5, 3, 2}));
  EXPECT_NEAR(s.volume, 24, 1e-12);
  EXPECT_NEAR(s.area, 52, 1e-12);
  ASSERT_EQ(s.regions.size(), 1U);
  EXPECT_EQ(s.regions[0].elements, 144);
  EXPECT_NEAR(s.groups[1].area, 6, 1e-12);
  EXPECT_EQ(s.groups[1].facets, 12);
  // Kuhn's tetrahedra are alike: edges 1, 1, 1, sqrt 2, sqrt 2, sqrt 3; volume 1/6.
  const Real quality = std::sqrt(2.0) / std::pow(10.0 / 6.0, 1.5);
  EXPECT_NEAR(s.quality.min, quality, 1e-14);
  EXPECT_NEAR(s.quality.max, quality, 1e-14);
  EXPECT_NEAR(s.quality.p01, quality, 1e-14);
  EXPECT_EQ(s.quality.bins[6], 144);
  EXPECT_NEAR(s.edges.mean, (3 + 2 * std::sqrt(2.0) + std::sqrt(3.0)) / 6, 1e-14);
  EXPECT_EQ(s.edges.first_edge, 1);
  EXPECT_EQ(s.edges.bins, std::vector<GlobalId>{144 * 6});
}

TEST(MeshStatistics, TheLowestHundredthIsFound) {
  test::BoxMeshOptions box;
  box.dim = 2;
  box.cells = {100, 10, 0};
  box.jitter = 0.2;
  const Mesh mesh = box_mesh(world(), box);
  const MeshStatistics s = mesh_statistics(world(), mesh);
  EXPECT_GT(s.quality.p01, s.quality.min);
  EXPECT_LT(s.quality.p01, s.quality.mean);
  EXPECT_EQ(std::accumulate(s.quality.bins.begin(), s.quality.bins.end(), GlobalId{0}), s.elements);
  EXPECT_NEAR(s.volume, 1, 1e-12);
}

TEST(MeshStatistics, OfNothingAreZero) {
  MeshPiece piece;
  piece.region_names = {"nothing"};
  const MeshStatistics s = mesh_statistics(world(), assemble_mesh(world(), piece).mesh);
  EXPECT_EQ(s.elements, 0);
  EXPECT_EQ(s.volume, 0);
  EXPECT_EQ(s.edges.mean, 0);
}

}  // namespace
}  // namespace malleus
