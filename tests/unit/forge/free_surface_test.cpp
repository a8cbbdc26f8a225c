#include "forge/free_surface.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "support/world.hpp"
#include "two_boxes.hpp"

namespace malleus::forge {
namespace {

using malleus::test::box_mesh;
using malleus::test::world;
using test::Layout;

std::vector<char> all_free(const Mesh& mesh) {
  return std::vector<char>(mesh.group_names.size() + 1, 1);
}

class OnLayout : public testing::TestWithParam<std::tuple<int, Layout>> {
 protected:
  OnLayout() {
    const auto [dim, layout] = GetParam();
    mesh = box_mesh(world(), {.dim = dim, .cells = {3, 4, 2}, .high = {1, 2, 3}, .jitter = 0.1});
    test::lay_out(world(), mesh, layout);
  }
  Mesh mesh;
};

TEST_P(OnLayout, SharesOfAClosedSurfaceAddUpToItsAreaAndToNoVector) {
  const FreeSurface surface(world(), mesh, Geometry::plane, all_free(mesh));
  Real area = 0;
  Vector sum = Vector::Zero();
  Real top = 0;
  for (std::size_t i = 0; i < surface.nodes().size(); ++i) {
    area += surface.area(i);
    for (const Vector& share : surface.shares(i)) sum += share;
    top += surface.facing_area(i, -Vector::UnitY());
    EXPECT_NEAR(surface.normal(i).norm(), 1, 1e-14);
  }
  EXPECT_NEAR(world().sum(area), mesh.dim == 3 ? 22 : 6, 1e-12);
  EXPECT_NEAR(world().sum(sum.sum()), 0, 1e-12);
  EXPECT_NEAR(world().sum(top), mesh.dim == 3 ? 3 : 1, 1e-12);
}

TEST_P(OnLayout, HeldGroupsAreNotPartOfIt) {
  std::vector<char> is_free = all_free(mesh);
  is_free[static_cast<std::size_t>(mesh.find_group("y_high")) + 1] = 0;
  const FreeSurface surface(world(), mesh, Geometry::plane, is_free);
  Real top = 0;
  for (std::size_t i = 0; i < surface.nodes().size(); ++i) top += surface.facing_area(i, -Vector::UnitY());
  EXPECT_NEAR(world().sum(top), 0, 1e-12);
}

TEST_P(OnLayout, SharpEdgesAreNotSmoothed) {
  const FreeSurface surface(world(), mesh, Geometry::plane, all_free(mesh));
  for (const LocalId facet : surface.facets()) {
    for (int k = 0; k < mesh.dim; ++k) {
      const Vector normal = surface.corner_normal(facet, k);
      EXPECT_NEAR(normal.cwiseAbs().maxCoeff(), 1, 1e-12);
    }
  }
}

TEST_P(OnLayout, GentleBendsAreSmoothedAlikeOnAllRanks) {
  // The top face bent to a parabola: corner normals at one node agree over all facets of the face.
  for (LocalId n = 0; n < mesh.nodes(); ++n) mesh.point(n)[1] += 0.05 * mesh.point(n)[0] * mesh.point(n)[0];
  const FreeSurface surface(world(), mesh, Geometry::plane, all_free(mesh));
  const int top = mesh.find_group("y_high");
  std::vector<Real> highest(static_cast<std::size_t>(mesh.nodes()), -1e300);
  std::vector<Real> lowest(highest.size(), 1e300);
  for (const LocalId facet : surface.facets()) {
    if (mesh.facet_group[static_cast<std::size_t>(facet)] != top) continue;
    for (int k = 0; k < mesh.dim; ++k) {
      const auto node = static_cast<std::size_t>(mesh.nodes_of_facet(facet)[static_cast<std::size_t>(k)]);
      const Real slope = surface.corner_normal(facet, k)[0];
      highest[node] = std::max(highest[node], slope);
      lowest[node] = std::min(lowest[node], slope);
    }
  }
  mesh.node_halo.max_to_owners(highest, 1);
  mesh.node_halo.min_to_owners(lowest, 1);
  for (LocalId n = 0; n < mesh.owned_nodes(); ++n) {
    const auto i = static_cast<std::size_t>(n);
    if (highest[i] > -1e300) {
      EXPECT_EQ(highest[i], lowest[i]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Layouts, OnLayout,
                         testing::Combine(testing::Values(2, 3),
                                          testing::Values(Layout::as_built, Layout::all_on_the_last,
                                                          Layout::scattered)));

TEST(FreeSurface, MeanEdgeIsThatOfTheBody) {
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {4, 4, 0}});
  const FreeSurface surface(world(), mesh, Geometry::plane, all_free(mesh));
  EXPECT_NEAR(surface.mean_edge(world(), 0), 0.25, 1e-14);
  EXPECT_EQ(surface.mean_edge(world(), 1), 0);
}

TEST(FreeSurface, OfARevolvedBodyHasTheRingsArea) {
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {4, 4, 0}, .high = {2, 1, 1}});
  const FreeSurface surface(world(), mesh, Geometry::axisymmetric, all_free(mesh));
  Real area = 0;
  for (std::size_t i = 0; i < surface.nodes().size(); ++i) area += surface.area(i);
  EXPECT_NEAR(world().sum(area), std::numbers::pi * (2 * 4 + 2 * 2 * 1), 1e-12);  // two discs, one wall; not the axis
}

}  // namespace
}  // namespace malleus::forge
