/// Words, numbers and near names.

#include "base/text.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace malleus {
namespace {

TEST(Text, TrimsAndSplits) {
  EXPECT_EQ(trim(" \t a b\r\n"), "a b");
  EXPECT_EQ(trim("  \t"), "");
  EXPECT_EQ(split_words(" a \"b c\"  d"), (std::vector<std::string>{"a", "b c", "d"}));
  EXPECT_EQ(split_words("\"open end"), (std::vector<std::string>{"open end"}));
  EXPECT_TRUE(split_words("   ").empty());
}

TEST(Text, RealsReadBackAsWritten) {
  for (const Real value : {0.0, -0.0, 0.1, 1e-300, 5e-324, std::numbers::pi, 1.0 / 3, 179.2e6,
                           std::numeric_limits<Real>::max(), -1e22, 123456789012345678.0}) {
    const std::string text = format_real(value);
    std::string_view rest = text;
    const auto back = take_real(rest);
    ASSERT_TRUE(back) << text;
    EXPECT_EQ(*back, value) << text;
    EXPECT_EQ(rest, "");
  }
}

TEST(Text, TakesOnlyFiniteDecimals) {
  for (const std::string_view text :
       {"nan", "inf", "-inf", "NaN", "1e999", "-", "+", ".", "", "x", "+-1", "--1", "e5"}) {
    std::string_view rest = text;
    EXPECT_FALSE(take_real(rest)) << text;
    EXPECT_EQ(rest, text);
  }
  std::string_view rest = "+1.5e3mm";
  EXPECT_EQ(take_real(rest), 1500.0);
  EXPECT_EQ(rest, "mm");
  rest = "0x10";
  EXPECT_EQ(take_real(rest), 0.0);
  EXPECT_EQ(rest, "x10");
}

TEST(Text, FindsTheNearestName) {
  const std::vector<std::string> known = {"consistency", "rate_sensitivity", "density", "norton-hoff"};
  EXPECT_EQ(nearest_name("consistensy", known), "consistency");
  EXPECT_EQ(nearest_name("DENSITY", known), "density");
  EXPECT_EQ(nearest_name("dnesity", known), "density");
  EXPECT_EQ(nearest_name("norton", known), "norton-hoff");
  EXPECT_EQ(nearest_name("no", known), "");
  EXPECT_EQ(nearest_name("temperature", known), "");
  EXPECT_EQ(nearest_name("", known), "");
  EXPECT_EQ(nearest_name(std::string(1000, 'a'), known), "");
  EXPECT_EQ(did_you_mean("x", std::vector<std::string>{"y"}), "");
  EXPECT_EQ(did_you_mean("rate-sensitivity", known), "; did you mean 'rate_sensitivity'?");
}

}  // namespace
}  // namespace malleus
