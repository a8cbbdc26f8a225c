#include "engine/error_budget.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace malleus {
namespace {

ErrorBudget two_sources() {
  ErrorBudget budget;
  budget.add({"linear", 1e-4, "linear_tolerance", "[solver] linear_tolerance", 0.5, 1.05});
  budget.add({"space", 0.02, "two meshes", "[remesh] size", 0.7, 4});
  return budget;
}

TEST(ErrorBudget, AddsTheSquaresOfItsSourcesAndPutsTheLargestFirst) {
  const ErrorBudget budget = two_sources();
  EXPECT_NEAR(budget.total(), std::hypot(1e-4, 0.02), 1e-15);
  ASSERT_EQ(budget.shares().size(), 2U);
  EXPECT_EQ(budget.shares().front().source, "space");
  EXPECT_EQ(budget.json().at(1).at("knob"), "[solver] linear_tolerance");
}

TEST(ErrorBudget, NamesTheKnobToTurnFirst) {
  const std::vector<std::string> lines = two_sources().lines();
  ASSERT_EQ(lines.size(), 4U);
  EXPECT_NE(lines.front().find("2 %"), std::string::npos) << lines.front();
  EXPECT_NE(lines.back().find("[remesh] size times 0.7"), std::string::npos) << lines.back();
}

TEST(ErrorBudget, IsSilentWithoutSources) {
  EXPECT_TRUE(ErrorBudget().lines().empty());
  EXPECT_EQ(ErrorBudget().total(), 0);
}

TEST(ErrorBudget, RefusesWhatIsNoSize) {
  ErrorBudget budget;
  EXPECT_THROW(budget.add({"space", std::numeric_limits<Real>::quiet_NaN(), "", "", 0.5, 1}), Defect);
  EXPECT_THROW(budget.add({"space", -1, "", "", 0.5, 1}), Defect);
}

TEST(ErrorBudget, WhatIsUnknownMakesTheRestALeast) {
  ErrorBudget budget = two_sources();
  budget.add_unknown("front", "nothing told it");
  EXPECT_NE(budget.lines()[0].find("at least"), std::string::npos);
  EXPECT_NE(budget.lines()[1].find("front"), std::string::npos);
  EXPECT_EQ(budget.unknown(), std::vector<std::string>{"front"});
  EXPECT_EQ(budget.total(), two_sources().total());
}

}  // namespace
}  // namespace malleus
