#include "fem/cut_simplex.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace malleus {
namespace {

SimplexPoints<2> triangle() {
  SimplexPoints<2> points;
  points << 0, 1, 0, 0, 0, 1;
  return points;
}
SimplexPoints<3> tetrahedron() {
  SimplexPoints<3> points;
  points << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  return points;
}

Real fraction(std::vector<Real> values) {
  return positive_fraction(values);
}

/// Volume of {lambda . values > 0} by the divided difference sum v_i^D / prod (v_i - v_j) over the positive vertices
/// (Lasserre 2015): an independent closed form, valid for distinct values.
Real divided_difference(const std::vector<Real>& values) {
  Real sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] <= 0) continue;
    Real term = 1;
    for (std::size_t j = 0; j < values.size(); ++j) {
      if (j != i) term *= values[i] / (values[i] - values[j]);
    }
    sum += term;
  }
  return sum;
}

TEST(CutFraction, HasTheLimitsOfUncutSimplices) {
  EXPECT_EQ(fraction({1, 2, 3}), 1);
  EXPECT_EQ(fraction({-1, -2, -3, -1}), 0);
  EXPECT_EQ(fraction({0, 0, 0, 0}), 0);
  EXPECT_EQ(fraction({0, 1, 1}), 1);
  EXPECT_EQ(fraction({0, 0, -1}), 0);
  EXPECT_EQ(fraction({0, 0, 1, 1}), 1);
}

TEST(CutFraction, OfASegmentATriangleAndATetrahedronByHand) {
  EXPECT_DOUBLE_EQ(fraction({3, -1}), 0.75);
  EXPECT_DOUBLE_EQ(fraction({1, -1, -1}), 0.25);
  EXPECT_DOUBLE_EQ(fraction({-1, 1, 1}), 0.75);
  EXPECT_DOUBLE_EQ(fraction({1, -1, -1, -1}), 0.125);
  EXPECT_DOUBLE_EQ(fraction({1, 1, -1, -1}), 0.5);
  EXPECT_DOUBLE_EQ(fraction({1, 1, -1, 1}), 0.875);
}

TEST(CutFraction, AgreesWithTheDividedDifferenceForManySigns) {
  unsigned state = 12345;
  const auto next = [&] {
    state = state * 1664525u + 1013904223u;
    return static_cast<Real>(state >> 8) / (1 << 23) - 1;
  };
  for (int sample = 0; sample < 2000; ++sample) {
    std::vector<Real> values(sample % 2 == 0 ? 3 : 4);
    for (Real& value : values) value = next();
    std::vector<Real> opposite = values;
    for (Real& value : opposite) value = -value;
    EXPECT_NEAR(fraction(values), divided_difference(values), 1e-7);
    EXPECT_NEAR(fraction(values) + fraction(opposite), 1, 1e-13);
  }
}

TEST(CutFraction, StaysBetweenZeroAndOneForNearlyEqualAndTinyValues) {
  for (const Real tiny : {1e-300, 1e-16, 1e-8}) {
    for (const auto& values : std::vector<std::vector<Real>>{
             {tiny, -tiny, 1, -1}, {tiny, tiny, -tiny, -1}, {1, 1 + tiny, -tiny, -tiny}, {tiny, -1, -1, -1}}) {
      EXPECT_GE(fraction(values), 0);
      EXPECT_LE(fraction(values), 1);
    }
  }
}

TEST(ZeroFacets, LieOnTheZeroSetAndHaveItsMeasure) {
  const std::vector<Real> half = {0.5, -0.5, 0.5};  // x < 1/2
  const auto cut = zero_facets<2>(triangle(), half);
  ASSERT_EQ(cut.count, 1);
  EXPECT_DOUBLE_EQ(facet_measure<2>(cut.facets[0]), 0.5);
  EXPECT_DOUBLE_EQ(cut.facets[0](0, 0), 0.5);
  EXPECT_DOUBLE_EQ(cut.facets[0](0, 1), 0.5);

  const std::vector<Real> quadrilateral = {0.5, -0.5, -0.5, 0.5};  // x + y < 1/2: a square of sides 1/2 and 1/sqrt(2)
  const auto square = zero_facets<3>(tetrahedron(), quadrilateral);
  ASSERT_EQ(square.count, 2);
  EXPECT_NEAR(facet_measure<3>(square.facets[0]) + facet_measure<3>(square.facets[1]), 0.5 * std::sqrt(0.5), 1e-15);
  EXPECT_EQ(zero_facets<3>(tetrahedron(), std::vector<Real>{0, 0, 0, 1}).count, 0);
}

TEST(ClosestPoint, FallsOnFaceEdgeAndVertex) {
  Eigen::Matrix<Real, 3, 3> facet;
  facet << 0, 1, 0, 0, 0, 1, 0, 0, 0;  // corners (0,0,0), (1,0,0), (0,1,0)
  EXPECT_NEAR((closest_point<3>(facet, {0.2, 0.3, 5}) - Point<3>(0.2, 0.3, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((closest_point<3>(facet, {0.5, -2, 1}) - Point<3>(0.5, 0, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((closest_point<3>(facet, {1, 1, 0}) - Point<3>(0.5, 0.5, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((closest_point<3>(facet, {3, -1, 1}) - Point<3>(1, 0, 0)).norm(), 0, 1e-15);
  Eigen::Matrix<Real, 3, 3> needle;
  needle << 0, 1, 2, 0, 0, 0, 0, 0, 0;
  EXPECT_NEAR((closest_point<3>(needle, {1.5, 1, 0}) - Point<3>(1.5, 0, 0)).norm(), 0, 1e-15);
}

}  // namespace
}  // namespace malleus
