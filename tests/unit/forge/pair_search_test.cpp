#include "forge/pair_search.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/world.hpp"
#include "two_boxes.hpp"

namespace malleus::forge {
namespace {

using malleus::test::world;
using test::Layout;
using test::positions_of;

/// Two blocks whose facing sides are wavy and do not match; the upper one is the slave.
Mesh wavy_blocks(int dim, Layout layout) {
  Mesh mesh =
      test::two_boxes(world(), {.dim = dim, .cells = {5, 4, 3}, .jitter = 0.1},
                      {.dim = dim, .cells = {7, 6, 5}, .low = {0.1, 1.02, 0.1}, .high = {0.9, 2, 0.9}, .jitter = 0.1});
  if (dim == 3) {  // the facing sides are those of y
    for (LocalId n = 0; n < mesh.nodes(); ++n) mesh.point(n)[1] += 0.02 * std::sin(5 * mesh.point(n)[2]);
  }
  for (LocalId n = 0; n < mesh.nodes(); ++n) mesh.point(n)[1] += 0.03 * std::sin(4 * mesh.point(n)[0]);
  test::lay_out(world(), mesh, layout);
  return mesh;
}

/// Sums over all pairs that tell one set of pairs from another.
std::array<Real, 5> fingerprint(const Mesh& mesh, const std::vector<NodeFacetPair>& pairs) {
  std::array<Real, 5> sums{};
  for (const NodeFacetPair& pair : pairs) {
    const Vector at = to_vector(mesh.point(pair.slave), mesh.dim);
    sums[0] += 1;
    sums[1] += pair.gap;
    sums[2] += pair.gap * at[0];
    sums[3] += pair.normal[0] * (1 + at[2]);
    sums[4] +=
        pair.weights[0] * pair.weights[0] + pair.weights[1] * pair.weights[1] + pair.weights[2] * pair.weights[2];
  }
  world().sum_in_place(sums);
  return sums;
}

std::vector<NodeFacetPair> search(const Mesh& mesh, Real reach) {
  const std::vector<char> is_free(mesh.group_names.size() + 1, 1);
  const FreeSurface surface(world(), mesh, Geometry::plane, is_free);
  return find_pairs(world(), surface, positions_of(mesh), {1, 0, reach});
}

class PairSearchIn : public testing::TestWithParam<int> {};

TEST_P(PairSearchIn, DoesNotDependOnThePartition) {
  const Mesh reference_mesh = wavy_blocks(GetParam(), Layout::all_on_the_last);
  const auto reference = fingerprint(reference_mesh, search(reference_mesh, 0.12));
  EXPECT_GT(reference[0], GetParam() == 3 ? 30 : 5);
  for (const Layout layout : {Layout::as_built, Layout::scattered}) {
    const Mesh mesh = wavy_blocks(GetParam(), layout);
    const auto found = fingerprint(mesh, search(mesh, 0.12));
    EXPECT_EQ(found[0], reference[0]);
    for (std::size_t i = 1; i < found.size(); ++i) EXPECT_NEAR(found[i], reference[i], 1e-10);
  }
}

/// All facets tried one by one, on a mesh that one rank has.
TEST_P(PairSearchIn, FindsTheClosestOfAllFacets) {
  const Mesh mesh = wavy_blocks(GetParam(), Layout::all_on_the_last);
  const auto positions = positions_of(mesh);
  int compared = 0;
  for (const NodeFacetPair& pair : search(mesh, 0.12)) {
    const Vector& point = positions[static_cast<std::size_t>(pair.slave)];
    Real closest = 1e300;
    for (LocalId f = 0; f < mesh.exterior_facets; ++f) {
      const auto nodes = mesh.nodes_of_facet(f);
      if (mesh.element_region[static_cast<std::size_t>(mesh.facet_element[static_cast<std::size_t>(f)])] != 0) continue;
      FacetSet one;
      one.dim = mesh.dim;
      for (const LocalId node : nodes) one.points.push_back(positions[static_cast<std::size_t>(node)]);
      one.facets = {{0, 1, mesh.dim == 3 ? 2 : -1}};
      closest = std::min(closest, one.closest(0, point).squared_distance);
    }
    Vector at = Vector::Zero();
    for (std::size_t k = 0; k < static_cast<std::size_t>(mesh.dim); ++k) {
      at += pair.weights[k] * positions[static_cast<std::size_t>(pair.masters[k] - mesh.node_ownership.begin())];
    }
    EXPECT_NEAR((point - at).squaredNorm(), closest, 1e-14);
    EXPECT_NEAR(pair.gap, std::sqrt(closest), 0.05 * std::sqrt(closest) + 1e-4);  // along the smoothed normal
    ++compared;
  }
  if (mesh.elements() > 0) {
    EXPECT_GT(compared, 5);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, PairSearchIn, testing::Values(2, 3));

TEST(PairSearch, FlushSidesMeetFaceToFaceOnly) {
  // Blocks of one width: nodes of the slave's rim must meet the master's top, not its side wall.
  Mesh mesh = test::two_boxes(world(), {.cells = {3, 3, 3}}, {.cells = {4, 4, 4}, .low = {0, 1, 0}, .high = {1, 2, 1}});
  test::lay_out(world(), mesh, Layout::scattered);
  const auto pairs = search(mesh, 0.1);
  EXPECT_EQ(world().sum(static_cast<GlobalId>(pairs.size())), 25);
  for (const NodeFacetPair& pair : pairs) {
    EXPECT_NEAR((pair.normal - Vector::UnitY()).norm(), 0, 1e-12);
    EXPECT_NEAR(pair.gap, 0, 1e-14);
  }
}

TEST(PairSearch, NodesBeyondTheRimOrOutOfReachMeetNothing) {
  Mesh mesh =
      test::two_boxes(world(), {.cells = {3, 3, 3}}, {.cells = {4, 4, 4}, .low = {0.5, 1.05, 0}, .high = {1.5, 2, 1}});
  const auto pairs = search(mesh, 0.1);
  EXPECT_EQ(world().sum(static_cast<GlobalId>(pairs.size())), 15);  // x = 0.5, 0.75, 1 of each row
  EXPECT_TRUE(search(mesh, 0.04).empty());
}

TEST(PairSearch, PenetrationIsANegativeGap) {
  Mesh mesh =
      test::two_boxes(world(), {.cells = {3, 3, 3}}, {.cells = {4, 4, 4}, .low = {0, 0.99, 0}, .high = {1, 2, 1}});
  for (const NodeFacetPair& pair : search(mesh, 0.1)) EXPECT_NEAR(pair.gap, -0.01, 1e-12);
}

/// The upper block overlaps the lower by 0.01 and stands out over its side x = 1 by 0.1.
Mesh standing_out(Layout layout) {
  Mesh mesh =
      test::two_boxes(world(), {.cells = {3, 3, 3}}, {.cells = {4, 4, 4}, .low = {0.1, 0.99, 0}, .high = {1.1, 2, 1}});
  // What stands out is folded down beside the lower block, 0.03 away from it.
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    if (mesh.point(n)[0] > 1.05 && mesh.point(n)[1] < 1) {
      mesh.point(n)[0] = 1.03;
      mesh.point(n)[1] = 0.85;
    }
  }
  test::lay_out(world(), mesh, layout);
  return mesh;
}

TEST(PairSearch, ANodeFoldedRoundTheRimDoesNotMeetTheTop) {
  for (const Layout layout : {Layout::as_built, Layout::scattered, Layout::all_on_the_last}) {
    const Mesh mesh = standing_out(layout);
    const auto pairs = search(mesh, 0.2);
    GlobalId on_top = 0;
    for (const NodeFacetPair& pair : pairs) {
      const bool is_top = pair.normal[1] > 0.9;
      on_top += is_top ? 1 : 0;
      EXPECT_NEAR(pair.gap, is_top ? -0.01 : 0.03, 1e-12);  // else the side that it is folded down to
    }
    EXPECT_EQ(world().sum(on_top), 20);  // x = 0.1, 0.35, 0.6, 0.85 of each row
  }
}

}  // namespace
}  // namespace malleus::forge
