#include "engine/space_estimate.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace malleus {
namespace {

/// Results of 1 + c h^p on sizes 1, r and r^2.
MeshComparison power_of_size(Real c, Real p, Real r) {
  MeshComparison comparison;
  comparison.first_ratio = r;
  comparison.second_ratio = r;
  comparison.first_difference = c * (std::pow(r, p) - 1);
  comparison.difference2 = c * (std::pow(r * r, p) - std::pow(r, p));
  return comparison;
}

TEST(SpaceEstimate, FindsOrderAndErrorOfAPowerOfTheSize) {
  for (const Real p : {1.0, 1.5, 2.0, 3.0}) {
    for (const Real r : {1.6, 2.0, 2.3}) {
      const MeshComparison comparison = power_of_size(0.01, p, r);
      EXPECT_NEAR(observed_order(comparison), p, 1e-12);
      EXPECT_NEAR(extrapolated_error(comparison), 0.01, 1e-12);
    }
  }
}

TEST(SpaceEstimate, TrustsTheElementsOrderWhereTwoMeshesAreAllThereIs) {
  MeshComparison comparison = power_of_size(0.01, 2, 2);
  comparison.difference2.reset();
  EXPECT_EQ(observed_order(comparison), 2);
  EXPECT_NEAR(extrapolated_error(comparison), 0.01, 1e-12);
}

TEST(SpaceEstimate, DoesNotTrustAnOrderThatDifferencesDoNotShow) {
  MeshComparison comparison = power_of_size(0.01, 2, 2);
  comparison.difference2 = comparison.first_difference / 3;
  EXPECT_EQ(observed_order(comparison), 2);
  comparison.difference2 = comparison.first_difference * 1e6;
  EXPECT_EQ(observed_order(comparison), 4);
  comparison.first_difference = 0;
  EXPECT_EQ(extrapolated_error(comparison), 0);
}

}  // namespace
}  // namespace malleus
