#include "engine/simpler_geometry.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;
using Axes = std::array<bool, 3>;

SceneParts plain_parts(const Mesh& mesh) {
  SceneParts parts;
  parts.class_of_group.assign(mesh.group_names.size() + 1, 0);
  parts.is_symmetry_plane = {0};
  return parts;
}

/// -1 to 1 in all directions.
Mesh box(int dim, int cells) {
  return test::box_mesh(world(), {dim, {cells, cells, cells}, {-1, -1, -1}, {1, 1, 1}, 0.2});
}

/// The square in x and y made a disc (0 to 1: its quarter); of few cells a polygon.
Mesh cylinder(int cells, Real low) {
  Mesh mesh = test::box_mesh(world(), {3, {cells, cells, 3}, {low, low, 0}, {1, 1, 2}});
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    Real* at = mesh.coordinates.data() + 3 * static_cast<std::size_t>(node);
    const Real x = at[0];
    const Real y = at[1];
    at[0] = x * std::sqrt(1 - y * y / 2);
    at[1] = y * std::sqrt(1 - x * x / 2);
  }
  return mesh;
}

SimplerGeometry found_in(const Mesh& mesh, const SceneParts& parts) {
  return find_simpler_geometry(world(), mesh, Geometry::plane, parts);
}

TEST(SimplerGeometry, ABoxIsItsMirrorImageInAllDirections) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = box(dim, 4);
    const SimplerGeometry found = found_in(mesh, plain_parts(mesh));
    EXPECT_EQ(found.is_mirrored, (Axes{true, true, dim == 3}));
    EXPECT_EQ(found.is_extruded, Axes{});
    EXPECT_TRUE(found.revolutions.empty());
  }
}

TEST(SimplerGeometry, AConditionOnOneSideMakesTheSidesDiffer) {
  const Mesh mesh = box(3, 3);
  SceneParts parts = plain_parts(mesh);
  parts.add_class(mesh.find_group("x_low"), false);
  EXPECT_EQ(found_in(mesh, parts).is_mirrored, (Axes{false, true, true}));
}

TEST(SimplerGeometry, AVectorMustLieInThePlane) {
  const Mesh mesh = box(3, 3);
  SceneParts parts = plain_parts(mesh);
  parts.vectors.push_back({0, -9.81, 0});
  EXPECT_EQ(found_in(mesh, parts).is_mirrored, (Axes{true, false, true}));
}

TEST(SimplerGeometry, ScalarsMustBeTheSameOnBothSides) {
  const Mesh mesh = box(3, 3);
  SceneParts parts = plain_parts(mesh);
  parts.scalars.emplace_back([](const std::array<Real, 3>& at) { return at[0] * at[0] + 0.01 * at[2]; });
  EXPECT_EQ(found_in(mesh, parts).is_mirrored, (Axes{true, true, false}));
}

TEST(SimplerGeometry, ADentOnOneSideIsSeen) {
  Mesh mesh = test::box_mesh(world(), {2, {8, 8, 1}, {-1, -1, 0}, {1, 1, 1}});
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    Real* at = mesh.coordinates.data() + 2 * static_cast<std::size_t>(node);
    if (at[1] > 0.99 && std::abs(at[0] - 0.25) < 0.01) at[1] -= 0.1;
  }
  EXPECT_EQ(found_in(mesh, plain_parts(mesh)).is_mirrored, Axes{});
}

TEST(SimplerGeometry, BetweenPlanesOfSymmetryAPrismIsASection) {
  const Mesh mesh = box(3, 3);
  SceneParts parts = plain_parts(mesh);
  parts.add_class(mesh.find_group("z_low"), true);
  EXPECT_FALSE(found_in(mesh, parts).is_extruded[2]);
  parts.add_class(mesh.find_group("z_high"), true);
  EXPECT_EQ(found_in(mesh, parts).is_extruded, (Axes{false, false, true}));
  parts.vectors.push_back({0, 0, 1});
  EXPECT_FALSE(found_in(mesh, parts).is_extruded[2]);
}

TEST(SimplerGeometry, ACylinderIsOfRevolutionAPolygonIsNot) {
  const Mesh round = cylinder(8, -1);
  SceneParts parts = plain_parts(round);
  ASSERT_EQ(found_in(round, parts).revolutions.size(), 1U);
  EXPECT_EQ(found_in(round, parts).revolutions[0].axis, 2U);
  parts.scalars.emplace_back([](const std::array<Real, 3>& at) { return std::hypot(at[0], at[1]) - at[2]; });
  EXPECT_EQ(found_in(round, parts).revolutions.size(), 1U);
  parts.scalars.emplace_back([](const std::array<Real, 3>& at) { return std::abs(at[0]); });
  EXPECT_TRUE(found_in(round, parts).revolutions.empty());
  const Mesh octagon = cylinder(2, -1);
  EXPECT_TRUE(found_in(octagon, plain_parts(octagon)).revolutions.empty());
}

TEST(SimplerGeometry, AQuarterIsOfRevolutionAboutTheEdgeOfItsPlanes) {
  const Mesh quarter = cylinder(4, 0);
  SceneParts parts = plain_parts(quarter);
  EXPECT_TRUE(found_in(quarter, parts).revolutions.empty());
  parts.add_class(quarter.find_group("x_low"), true);
  parts.add_class(quarter.find_group("y_low"), true);
  const SimplerGeometry found = found_in(quarter, parts);
  ASSERT_EQ(found.revolutions.size(), 1U);
  EXPECT_EQ(found.revolutions[0].axis, 2U);
  EXPECT_NEAR(found.revolutions[0].through[0], 0, 1e-12);
  EXPECT_NEAR(found.revolutions[0].through[1], 0, 1e-12);
  parts.add_class(quarter.find_group("x_high"), false);
  EXPECT_TRUE(found_in(quarter, parts).revolutions.empty());
}

TEST(SimplerGeometry, LinesAreTheBestThatCanBeSaid) {
  const Mesh round = cylinder(8, -1);
  const auto lines = found_in(round, plain_parts(round)).suggestions("[symmetry.NAME]");
  ASSERT_EQ(lines.size(), 2U);  // the revolution, and the middle plane that it leaves
  EXPECT_NE(lines[0].find("of revolution along z about x = 0 m, y = 0 m"), std::string::npos);
  EXPECT_NE(lines[1].find("z = 1 m"), std::string::npos);
}

}  // namespace
}  // namespace malleus
