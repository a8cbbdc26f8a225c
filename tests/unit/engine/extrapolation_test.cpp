#include "engine/extrapolation.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace malleus {
namespace {

/// Results of limit (1 + c h^p) on sizes 1, 2 and 3.
MeshComparison power_of_size(Real c, Real p) {
  MeshComparison comparison;
  for (const Real size : {1.0, 2.0, 3.0}) {
    comparison.sizes.push_back(size);
    comparison.results.push_back({5 * (1 + c * std::pow(size, p)), -2 * (1 + c * std::pow(size, p))});
  }
  return comparison;
}

TEST(Extrapolation, FindsOrderAndErrorOfAPowerOfTheSize) {
  for (const Real p : {1.6, 1.75, 1.9}) {
    for (const Real c : {0.01, -0.002}) {
      const MeshComparison comparison = power_of_size(c, p);
      EXPECT_NEAR(observed_order(comparison), p, 1e-10);
      EXPECT_NEAR(extrapolated_error(comparison), std::abs(c / (1 + c)), 1e-10);
    }
  }
}

TEST(Extrapolation, TrustsNoOrderThatTheElementHasNot) {
  EXPECT_NEAR(observed_order(power_of_size(0.01, 2.8)), 2, 1e-10);
  EXPECT_NEAR(observed_order(power_of_size(0.01, 0.5)), 1.5, 1e-10);
}

TEST(Extrapolation, LeavesAMeshOutThatIsTooCoarseToTell) {
  MeshComparison comparison = power_of_size(0.01, 1.75);
  const MeshComparison two = {{1, 2}, {comparison.results[0], comparison.results[1]}};
  comparison.results[2][0] *= 3;
  EXPECT_EQ(extrapolated_error(comparison), extrapolated_error(two));
}

TEST(Extrapolation, TakesTheUsualOrderOfTwoMeshes) {
  MeshComparison comparison = power_of_size(0.01, 1.75);
  comparison.sizes.pop_back();
  comparison.results.pop_back();
  EXPECT_EQ(observed_order(comparison), 1.75);
  EXPECT_NEAR(extrapolated_error(comparison), 0.01 / 1.01, 1e-10);
}

TEST(Extrapolation, CountsWhatGoesToAndFroAsChance) {
  MeshComparison comparison;
  comparison.sizes = {1, 2, 3};
  comparison.results = {{1.0}, {1.01}, {1.0}};
  EXPECT_EQ(observed_order(comparison), 1.75);
  EXPECT_GT(extrapolated_error(comparison), 1e-3);
  comparison.results = {{1.0}, {1.0}, {1.0}};
  EXPECT_EQ(extrapolated_error(comparison), 0);
}

}  // namespace
}  // namespace malleus
