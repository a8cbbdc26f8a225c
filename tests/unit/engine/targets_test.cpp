#include "engine/targets.hpp"

#include <gtest/gtest.h>

namespace malleus {
namespace {

Expectation four_per_cent_in_100_s() {
  Expectation expected;
  expected.outlook = {2, 0.04, 2};
  expected.increments = 50;
  return expected;
}

TEST(Targets, AQuarterOfTheErrorWantsHalfTheSizes) {
  AccuracySettings asked;
  asked.target_error = 0.01;
  const Choice choice = choose_for(asked, four_per_cent_in_100_s());
  EXPECT_NEAR(choice.size_factor, 0.5, 1e-12);
  EXPECT_EQ(choice.level, Level::standard);
  EXPECT_NE(choice.reason.find("800 s"), std::string::npos) << choice.reason;
}

TEST(Targets, AnEighthOfTheTimeTakesTwiceTheSizes) {
  AccuracySettings asked;
  asked.target_time = 12.5;
  Expectation expected = four_per_cent_in_100_s();
  EXPECT_NEAR(choose_for(asked, expected).size_factor, 2, 1e-12);
  expected.steps_follow_sizes = true;
  EXPECT_NEAR(choose_for(asked, expected).size_factor, 1.6818, 1e-4);
}

TEST(Targets, TimeWinsAndTheLogSaysSo) {
  AccuracySettings asked;
  asked.target_error = 0.01;
  asked.target_time = 100;
  const Choice choice = choose_for(asked, four_per_cent_in_100_s());
  EXPECT_NEAR(choice.size_factor, 1, 1e-12);
  EXPECT_EQ(choice.level, Level::draft);
  EXPECT_NE(choice.reason.find("out of reach"), std::string::npos);
}

TEST(Targets, StayWithinTheirBounds) {
  AccuracySettings asked;
  asked.target_error = 1e-6;
  const Choice finest = choose_for(asked, four_per_cent_in_100_s());
  EXPECT_EQ(finest.size_factor, 0.3);
  EXPECT_NE(finest.reason.find("out of reach"), std::string::npos);
  asked.target_error = 0.9;
  EXPECT_EQ(choose_for(asked, four_per_cent_in_100_s()).size_factor, 3);
}

}  // namespace
}  // namespace malleus
