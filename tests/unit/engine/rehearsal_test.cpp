#include "engine/rehearsal.hpp"

#include <gtest/gtest.h>

namespace malleus {
namespace {

Rehearsal on_nodes(Real nodes, Real first_s, Real later_s) {
  Rehearsal seen;
  seen.nodes = nodes;
  seen.first_s = first_s;
  seen.later_s = later_s;
  seen.increments = 20;
  seen.other_error = 0.04;
  return seen;
}

TEST(Rehearsal, TimesHaveAFixedPartAndOneThatGoesWithTheNodes) {
  const Rehearsal run = extrapolated_run({on_nodes(200, 0.5, 0.3), on_nodes(100, 0.3, 0.2)}, 800, 2, false);
  EXPECT_NEAR(run.first_s, 0.1 + 800 * 2e-3, 1e-12);
  EXPECT_NEAR(run.later_s, 0.1 + 800 * 1e-3, 1e-12);
  EXPECT_EQ(run.increments, 20);
  EXPECT_EQ(run.other_error, 0.04);
}

TEST(Rehearsal, NeitherPartIsNegative) {
  EXPECT_NEAR(extrapolated_run({on_nodes(200, 1, 0.3), on_nodes(100, 1, 0.1)}, 400, 3, false).later_s, 0.6, 1e-12);
  EXPECT_NEAR(extrapolated_run({on_nodes(200, 1, 0.3), on_nodes(100, 2, 0.4)}, 400, 3, false).later_s, 0.3, 1e-12);
}

TEST(Rehearsal, OneMeshCountsAllForItsNodes) {
  EXPECT_NEAR(extrapolated_run({on_nodes(200, 1, 0.3)}, 400, 3, false).later_s, 0.6, 1e-12);
}

TEST(Rehearsal, StepsThatFollowSizesAreMoreAndErrLess) {
  const Rehearsal run = extrapolated_run({on_nodes(100, 1, 0.3)}, 800, 3, true);
  EXPECT_EQ(run.increments, 40);
  EXPECT_NEAR(run.other_error, 0.02, 1e-12);
}

}  // namespace
}  // namespace malleus
