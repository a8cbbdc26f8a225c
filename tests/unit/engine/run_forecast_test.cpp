#include "engine/run_forecast.hpp"

#include <gtest/gtest.h>

#include "support/world.hpp"

namespace malleus {
namespace {

TEST(RunForecast, OfSeveralEndsTheOneThatComesFirstCounts) {
  const Stand earlier = {2, 10, {0.1, 0, 0.5}};
  const Stand here = {6, 18, {0.3, 0, 0.51}};
  const auto rest = rest_after(earlier, here);
  ASSERT_TRUE(rest);
  EXPECT_NEAR(rest->increments, 14, 1e-9);
  EXPECT_NEAR(rest->wall_s, 28, 1e-9);
}

TEST(RunForecast, WithoutProgressNothingIsTold) {
  EXPECT_FALSE(rest_after({2, 10, {0.1, 0, 0}}, {6, 18, {0.1, 0, 0}}));
}

/// Of 100 increments: the first lasts ten seconds, the others one.
Stand after(GlobalId increment, Real each_s) {
  return {increment, 10 + each_s * static_cast<Real>(increment - 1), {static_cast<Real>(increment) / 100, 0, 0}};
}

TEST(RunForecast, AProbeOfShortIncrementsIsATenthOfThem) {
  RunForecast forecast;
  GlobalId made = 0;
  for (GlobalId increment = 1; increment <= 100; ++increment) {
    if (forecast.see(test::world(), after(increment, 0.1), 3)) made = increment;
  }
  EXPECT_EQ(made, 10);
  EXPECT_EQ(forecast.made_after(), 10);
  EXPECT_EQ(forecast.made()->increments, 100);
  EXPECT_NEAR(forecast.made()->wall_s, 10 + 9.9 + 3, 1e-9);
  EXPECT_GT(forecast.made()->memory_bytes, 0);
}

TEST(RunForecast, AProbeOfLongIncrementsIsSixOfThem) {
  RunForecast forecast;
  for (GlobalId increment = 1; increment <= 5; ++increment) {
    EXPECT_FALSE(forecast.see(test::world(), after(increment, 1), 0));
  }
  EXPECT_TRUE(forecast.see(test::world(), after(6, 1), 0));
  EXPECT_NEAR(forecast.made()->wall_s, 10 + 99, 1e-9);
  EXPECT_NEAR(forecast.rest(after(50, 1))->wall_s, 50, 1e-9);
}

TEST(RunForecast, ARestartKeepsIt) {
  RunForecast forecast;
  RunForecast restarted;
  restarted.restore(forecast.save());
  EXPECT_FALSE(restarted.made());
  for (GlobalId increment = 1; increment <= 10; ++increment) forecast.see(test::world(), after(increment, 1), 0);
  restarted.restore(forecast.save());
  EXPECT_EQ(restarted.made()->wall_s, forecast.made()->wall_s);
  EXPECT_EQ(restarted.made()->increments, forecast.made()->increments);
  EXPECT_EQ(restarted.made_after(), forecast.made_after());
}

}  // namespace
}  // namespace malleus
