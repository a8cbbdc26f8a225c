#include "fem/level_set_volume.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fem/level_set_shapes.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

template <class Shape>
std::vector<Real> level_set_of(const Mesh& mesh, const Shape& shape) {
  std::vector<Real> level_set;
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    Position at = {0, 0, 0};
    for (int c = 0; c < mesh.dim; ++c) at[static_cast<std::size_t>(c)] = mesh.point(n)[c];
    level_set.push_back(signed_distance(shape, at));
  }
  return level_set;
}

TEST(Shapes, ArePositiveInsideAndMeasureDistance) {
  EXPECT_DOUBLE_EQ(signed_distance(Sphere{{1, 0, 0}, 2}, {1, 0, 0}), 2);
  EXPECT_DOUBLE_EQ(signed_distance(Sphere{{1, 0, 0}, 2}, {1, 3, 0}), -1);
  EXPECT_DOUBLE_EQ(signed_distance(AxisBox{{0, 0, 0}, {2, 4, 6}, 3}, {0.5, 0, 0}), 0.5);
  EXPECT_DOUBLE_EQ(signed_distance(AxisBox{{0, 0, 0}, {2, 4, 6}, 3}, {4, 6, 0}), -5);
  EXPECT_DOUBLE_EQ(signed_distance(AxisBox{{0, 0, 0}, {2, 2, 0}, 2}, {0, 0, 0}), 1);
  EXPECT_DOUBLE_EQ(signed_distance(HalfSpace{{1, 0, 0}, {10, 0, 0}}, {0.25, 7, 0}), 0.75);
}

TEST(PositiveVolume, OfAPlaneIsExactOnAnyMesh) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = test::box_mesh(test::world(), {dim, {5, 4, 3}, {0, 0, 0}, {1, 1, 1}, 0.2});
    const auto measures = element_measures(mesh, false);
    // x + y < 0.8 takes 0.32 of the unit square.
    const auto level_set = level_set_of(mesh, HalfSpace{{0.8, 0, 0}, {1, 1, 0}});
    EXPECT_NEAR(positive_volume(test::world(), mesh, measures, level_set), 0.32, 1e-14);
  }
}

TEST(PositiveVolume, OfADiscConvergesWithSecondOrder) {
  std::array<Real, 2> errors;
  for (std::size_t i = 0; i < 2; ++i) {
    const int n = i == 0 ? 16 : 32;
    const Mesh mesh = test::box_mesh(test::world(), {2, {n, n, 1}, {0, 0, 0}, {1, 1, 0}, 0.15});
    const auto level_set = level_set_of(mesh, Sphere{{0.5, 0.5, 0}, 0.3});
    errors[i] = std::abs(positive_volume(test::world(), mesh, element_measures(mesh, false), level_set) -
                         std::numbers::pi * 0.09);
  }
  EXPECT_LT(errors[1], 0.35 * errors[0]);
  EXPECT_LT(errors[1], 1e-3);
}

TEST(ElementMeasures, OfARevolvedSquareAreTheCylinder) {
  const Mesh mesh = test::box_mesh(test::world(), {2, {4, 4, 1}, {1, 0, 0}, {2, 1, 0}, 0.2});
  Real sum = 0;
  for (const Real measure : element_measures(mesh, true)) sum += measure;
  EXPECT_NEAR(test::world().sum(sum), 3 * std::numbers::pi, 1e-12);
}

TEST(RestoreVolume, ReachesTheTargetFromNearAndFar) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = test::box_mesh(test::world(), {dim, {8, 8, 8}, {0, 0, 0}, {1, 1, 1}, 0.2});
    const auto measures = element_measures(mesh, false);
    for (const Real target : {1e-4, 0.05, 0.3, 0.9, 0.9999}) {
      auto level_set = level_set_of(mesh, Sphere{{0.4, 0.5, 0.5}, 0.3});
      const auto restored = restore_volume(test::world(), mesh, measures, level_set, target);
      EXPECT_NEAR(restored.volume, target, 1e-13);
      EXPECT_NEAR(positive_volume(test::world(), mesh, measures, level_set), target, 1e-13);
    }
    auto level_set = level_set_of(mesh, Sphere{{0.4, 0.5, 0.5}, 0.3});
    EXPECT_NEAR(restore_volume(test::world(), mesh, measures, level_set, 0).volume, 0, 1e-13);
    EXPECT_NEAR(restore_volume(test::world(), mesh, measures, level_set, 7).volume, 1, 1e-13);
  }
}

TEST(RestoreVolume, LeavesALevelSetThatHasItsVolume) {
  const Mesh mesh = test::box_mesh(test::world(), {2, {8, 8, 1}, {0, 0, 0}, {1, 1, 0}, 0});
  auto level_set = level_set_of(mesh, HalfSpace{{0.3, 0, 0}, {1, 0, 0}});
  EXPECT_EQ(restore_volume(test::world(), mesh, element_measures(mesh, false), level_set, 0.3).shift, 0);
}

TEST(CutElements, AreThoseOfTheFront) {
  const Mesh mesh = test::box_mesh(test::world(), {3, {4, 4, 4}, {0, 0, 0}, {1, 1, 1}, 0});
  const auto level_set = level_set_of(mesh, HalfSpace{{0.3, 0, 0}, {1, 0, 0}});
  const auto cut = cut_elements(mesh, level_set);
  EXPECT_EQ(test::world().sum(static_cast<GlobalId>(cut.size())), 4 * 4 * 6);
}

}  // namespace
}  // namespace malleus
