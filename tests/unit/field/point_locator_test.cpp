#include "field/point_locator.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

class PointValuesIn : public testing::TestWithParam<int> {};

TEST_P(PointValuesIn, LinearFieldsAreReadExactlyAtAnyPoint) {
  const int dim = GetParam();
  test::BoxMeshOptions box;
  box.dim = dim;
  box.cells = {7, 5, 6};
  box.jitter = 0.2;
  const Mesh mesh = test::box_mesh(world(), box);
  FieldStore store;
  Field& field = store.declare(mesh, {"place", "m", Support::node, dim});
  std::copy(mesh.coordinates.begin(), mesh.coordinates.end(), field.values().begin());
  std::vector<Real> points;
  for (int i = 0; i < 200; ++i) {
    for (int c = 0; c < dim; ++c) points.push_back(std::fmod(0.37 * i + 0.61 * c * i + 0.05, 1.0));
  }
  const PointValues values = values_at_points(world(), mesh, {&field}, points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(values.found[i / static_cast<std::size_t>(dim)], 1);
    EXPECT_NEAR(values.values[i], points[i], 1e-13);
  }
}

TEST_P(PointValuesIn, CornersAreFoundAndOutsidePointsAreNot) {
  const int dim = GetParam();
  test::BoxMeshOptions box;
  box.dim = dim;
  const Mesh mesh = test::box_mesh(world(), box);
  FieldStore store;
  const Field& field = store.declare(mesh, {"one", "1", Support::element, 1});
  std::vector<Real> points(static_cast<std::size_t>(2 * dim), 1.0);
  points[0] = 1.001;
  const PointValues values = values_at_points(world(), mesh, {&field}, points);
  EXPECT_EQ(values.found[0], 0);
  EXPECT_EQ(values.found[1], 1);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, PointValuesIn, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
