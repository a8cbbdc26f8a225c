#include "forge/tool_shape.hpp"

#include <gtest/gtest.h>

#include "shapes.hpp"

namespace malleus::forge {
namespace {

using test::cloud;
using test::numerical_gradient;

/// |grad d| = 1, the normal is the gradient, and going by the distance along it meets the surface.
void expect_signed_distance(const ToolShape& shape, const std::vector<Vector>& points) {
  for (const Vector& point : points) {
    const SurfaceContact contact = shape.nearest(point);
    EXPECT_NEAR(contact.normal.norm(), 1, 1e-12);
    EXPECT_NEAR((contact.normal - numerical_gradient(shape, point)).norm(), 0, 1e-6) << point.transpose();
    EXPECT_NEAR(shape.nearest(point - contact.distance * contact.normal).distance, 0, 1e-12) << point.transpose();
  }
}

TEST(Plane, DistanceIsAlongTheNormalTowardTheMaterial) {
  const auto plane = make_plane({0, 0, 1}, {0, 0, -2});
  EXPECT_NEAR(plane->nearest({5, 6, 0.25}).distance, 0.75, 1e-15);
  EXPECT_NEAR(plane->nearest({5, 6, 1.5}).distance, -0.5, 1e-15);
  EXPECT_EQ(plane->nearest({1, 2, 3}).normal, Vector(0, 0, -1));
  expect_signed_distance(*make_plane({0.1, 0.2, 0.3}, {1, 2, -2}), cloud(50, 2));
}

TEST(Sphere, DistanceIsThatToTheCentreLessTheRadius) {
  const Vector centre(0.1, -0.2, 0.3);
  const auto outside = make_sphere(centre, 0.7, Side::outside);
  const auto inside = make_sphere(centre, 0.7, Side::inside);
  for (const Vector& point : cloud(50, 2)) {
    const Real distance = (point - centre).norm() - 0.7;
    EXPECT_NEAR(outside->nearest(point).distance, distance, 1e-14);
    EXPECT_NEAR(inside->nearest(point).distance, -distance, 1e-14);
  }
  expect_signed_distance(*outside, cloud(50, 2));
  expect_signed_distance(*inside, cloud(50, 2));
  EXPECT_NEAR(outside->nearest(centre).normal.norm(), 1, 1e-15);  // no direction there: any, but a unit one
}

TEST(Cylinder, InfiniteOneMeasuresFromItsAxis) {
  const auto cylinder = make_cylinder({1, 0, 0}, {0, 0, 3}, 0.5, 0, Side::outside);
  EXPECT_NEAR(cylinder->nearest({3, 0, 100}).distance, 1.5, 1e-14);
  EXPECT_NEAR(cylinder->nearest({1.2, 0, -7}).distance, -0.3, 1e-14);
  expect_signed_distance(*make_cylinder({0.1, 0.2, 0.3}, {1, 1, 2}, 0.5, 0, Side::outside), cloud(50, 2));
  expect_signed_distance(*make_cylinder({0.1, 0.2, 0.3}, {1, 1, 2}, 0.5, 0, Side::inside), cloud(50, 2));
}

TEST(Cylinder, FiniteOneHasFlatEndsAndRims) {
  const auto cylinder = make_cylinder({0, 0, 0}, {0, 0, 1}, 1, 4, Side::outside);
  EXPECT_NEAR(cylinder->nearest({0.2, 0, 3}).distance, 1, 1e-14);
  EXPECT_NEAR(cylinder->nearest({4, 0, 6}).distance, 5, 1e-14);  // 3 beyond the wall, 4 beyond the end
  EXPECT_NEAR(cylinder->nearest({0.9, 0, 0}).distance, -0.1, 1e-14);
  EXPECT_NEAR(cylinder->nearest({0, 0, -1.8}).distance, -0.2, 1e-14);
  expect_signed_distance(*make_cylinder({0.1, 0.2, 0.3}, {1, 1, 2}, 0.5, 0.8, Side::outside), cloud(100, 2));
}

TEST(Cylinder, ContainerHoldsWithWallAndEndAtOnce) {
  const auto container = make_cylinder({0, 0, 0}, {0, 0, 1}, 1, 4, Side::inside);
  std::vector<SurfaceContact> contacts;
  container->contacts({0.95, 0, -1.9}, 0.2, contacts);
  ASSERT_EQ(contacts.size(), 2U);
  EXPECT_NEAR(contacts[0].distance, 0.05, 1e-14);
  EXPECT_NEAR((contacts[0].normal - Vector(-1, 0, 0)).norm(), 0, 1e-14);
  EXPECT_NEAR(contacts[1].distance, 0.1, 1e-14);
  EXPECT_NEAR((contacts[1].normal - Vector(0, 0, 1)).norm(), 0, 1e-14);
  contacts.clear();
  container->contacts({0, 0, 0}, 0.2, contacts);
  EXPECT_TRUE(contacts.empty());
}

TEST(Box, FacesEdgesAndCornersFromOutside) {
  const auto box = make_box({1, 1, 1}, {2, 2, 2}, Side::outside);
  EXPECT_NEAR(box->nearest({3, 1, 1}).distance, 1, 1e-15);
  EXPECT_NEAR(box->nearest({5, 6, 1}).distance, 5, 1e-15);
  EXPECT_NEAR(box->nearest({3, 4, 4}).distance, 3, 1e-15);
  EXPECT_NEAR(box->nearest({1, 1, 1.9}).distance, -0.1, 1e-15);
  expect_signed_distance(*box, cloud(100, 3));
}

TEST(Box, CavityHoldsWithEachFaceByItself) {
  const auto cavity = make_box({0, 0, 0}, {2, 2, 2}, Side::inside);
  std::vector<SurfaceContact> contacts;
  cavity->contacts({0.99, 1.01, -0.98}, 0.1, contacts);
  ASSERT_EQ(contacts.size(), 3U);
  EXPECT_NEAR(contacts[0].distance, 0.01, 1e-14);
  EXPECT_EQ(contacts[0].normal, Vector(-1, 0, 0));
  EXPECT_NEAR(contacts[1].distance, -0.01, 1e-14);
  EXPECT_EQ(contacts[1].normal, Vector(0, -1, 0));
  EXPECT_NEAR(contacts[2].distance, 0.02, 1e-14);
  EXPECT_EQ(contacts[2].normal, Vector(0, 0, 1));
}

TEST(Box, AnEdgeOfNoLengthIsUnlimited) {
  const auto slab = make_box({0, 0, 0}, {2, 4, 0}, Side::outside);
  EXPECT_NEAR(slab->nearest({2, 0, 1e6}).distance, 1, 1e-15);
  EXPECT_NEAR(slab->nearest({4, 6, -3}).distance, 5, 1e-15);
}

}  // namespace
}  // namespace malleus::forge
