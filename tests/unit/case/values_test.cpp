/// Every type that a key may have: what is read, what is refused, and that what is written reads back.

#include "case/values.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "base/error.hpp"
#include "case/case_file.hpp"

namespace malleus {
namespace {

template <class T>
T read(const Converter<T>& converter, std::string_view raw) {
  Key key;
  return converter.read(raw, key);
}

template <class T>
void expect_refused(const Converter<T>& converter, std::initializer_list<std::string_view> texts) {
  for (const std::string_view text : texts) EXPECT_THROW(read(converter, text), InputError) << text;
}

template <class T>
void expect_round_trip(const Converter<T>& converter, const T& value) {
  EXPECT_EQ(read(converter, converter.write(value)), value) << converter.write(value);
}

TEST(Values, Reals) {
  const auto converter = real_converter("m/s");
  EXPECT_EQ(read(converter, "300 mm/min"), 5e-3);
  EXPECT_EQ(read(converter, "\"5 mm/s\""), 5e-3);
  for (const Real value : {0.1, -1.0 / 3, 1e-300, std::numbers::pi * 1e17}) expect_round_trip(converter, value);
  for (const Real value : {0.1, 179.2e6}) expect_round_trip(real_converter("Pa.s^m"), value);
  expect_round_trip(real_converter("K"), 293.15);
  expect_refused(converter, {"fast", "5 mm", "nan", "inf", "-nan", "1 2", "", "\"\"", "5,0"});
}

TEST(Values, WholeNumbers) {
  EXPECT_EQ(read(integer_converter(), "-12"), -12);
  EXPECT_EQ(read(count_converter(), "3e5"), 300000);
  EXPECT_EQ(read(count_converter(), "5000000000"), 5000000000);
  expect_round_trip(count_converter(), GlobalId{9007199254740991});
  expect_refused(integer_converter(), {"1.5", "3000000000", "-3e9", "nan", "x", "1 m", "1e300", ""});
  expect_refused(count_converter(), {"1.5", "1e17", "inf"});
}

TEST(Values, Flags) {
  for (const std::string_view text : {"yes", "true", "on", "1", "\"yes\""}) EXPECT_TRUE(read(flag_converter(), text));
  for (const std::string_view text : {"no", "false", "off", "0"}) EXPECT_FALSE(read(flag_converter(), text));
  expect_refused(flag_converter(), {"ja", "2", ""});
  expect_round_trip(flag_converter(), true);
  expect_round_trip(flag_converter(), false);
}

TEST(Values, TextAndWords) {
  EXPECT_EQ(read(string_converter(), "\"a ; b\""), "a ; b");
  EXPECT_EQ(read(string_converter(), "a b"), "a b");
  for (const std::string value : {"plain", " led by a blank", "with ; mark", "# mark"}) {
    expect_round_trip(string_converter(), value);
  }
  using Words = std::vector<std::string>;
  EXPECT_EQ(read(words_converter(), "a \"b c\" d"), (Words{"a", "b c", "d"}));
  expect_round_trip(words_converter(), Words{"velocity", "two words", "a;b"});
}

TEST(Values, Durations) {
  const auto converter = duration_converter();
  EXPECT_EQ(read(converter, "23:45:00"), 85500.0);
  EXPECT_EQ(read(converter, "1-12:00:30"), 129630.0);
  EXPECT_EQ(read(converter, "100:00:00"), 360000.0);
  EXPECT_EQ(read(converter, "2 h"), 7200.0);
  EXPECT_EQ(read(converter, "90"), 90.0);
  EXPECT_EQ(read(converter, "1.5 d"), 129600.0);
  expect_refused(converter,
                 {"23:45", "1:60:00", "1:00:60", "1:-1:00", "a:b:c", "1:2:3:4", "2 mm", ":", "1-", "::", ""});
  expect_round_trip(converter, 0.1);
}

TEST(Values, Vectors) {
  Key key;
  const auto converter = vector_converter("m/s");
  EXPECT_EQ(converter.read("0 0 -1 mm/s", key), (std::array<Real, 3>{0, 0, -1e-3}));
  EXPECT_EQ(key.components, 3);
  EXPECT_EQ(converter.read("1 2", key), (std::array<Real, 3>{1, 2, 0}));
  EXPECT_EQ(key.components, 2);
  expect_refused(converter, {"1", "1 2 3 4", "1 2 3 Pa", "1 x 3", "1 nan 3", "free 1 2", "", "1, 2, 3"});
  expect_round_trip(converter, {0.1, -1.0 / 3, 1e-300});
}

TEST(Values, VectorsWithFreeComponents) {
  using Partial = std::array<std::optional<Real>, 3>;
  const auto converter = partial_vector_converter("m/s");
  EXPECT_EQ(read(converter, "0 free -1 mm/s"), (Partial{0.0, std::nullopt, -1e-3}));
  EXPECT_EQ(read(converter, "free 2"), (Partial{std::nullopt, 2.0, std::nullopt}));
  EXPECT_EQ(read(converter, "free free"), Partial{});
  EXPECT_EQ(read(converter, "0 1 free 1/s * m"), (Partial{0.0, 1.0, std::nullopt}));
  expect_refused(converter,
                 {"free", "1", "fre 1 2", "1 2 3 4", "0 free 1 Pa", "free free free Pa", "freely 1 2", "", "nan 1 2"});
  expect_round_trip(converter, {0.1, std::nullopt, -1.0 / 3});
}

TEST(Values, ExpressionsOrNumbers) {
  const auto converter = expression_converter("Pa.s");
  EXPECT_EQ(read(converter, "10 cP")({}, 0), 0.01);
  EXPECT_EQ(read(converter, "\"10 cP\"")({}, 0), 0.01);
  EXPECT_TRUE(read(converter, "10").is_constant());
  EXPECT_EQ(read(converter, "\"1e3*(1+x)\"")({2, 0, 0}, 0), 3e3);
  EXPECT_EQ(read(converter, "1e3*(1+x)")({2, 0, 0}, 0), 3e3);
  EXPECT_EQ(read(converter, "\"2*t\"")({}, 4), 8.0);
  EXPECT_EQ(read(converter, "-x")({2, 0, 0}, 0), -2.0);
  expect_refused(converter, {"10 mm", "\"10 Pas\"", "1e3*(1+w)", "", "\"\"", "1 2", "x +", "nan", "1/0"});
  for (const std::string_view text : {"10 cP", "\"1e3*(1+x)\""}) {
    const Expression once = read(converter, text);
    const Expression twice = read(converter, converter.write(once));
    EXPECT_EQ(once({0.3, 0, 0}, 0), twice({0.3, 0, 0}, 0));
  }
}

TEST(Values, PathsAreRelativeToTheCase) {
  Key key;
  key.case_directory = "cases/press";
  EXPECT_EQ(path_converter().read("../part.msh", key), "cases/part.msh");
  EXPECT_EQ(path_converter().read("\"/data/my part.msh\"", key), "/data/my part.msh");
  key.case_directory = "";
  EXPECT_EQ(path_converter().read("part.msh", key), "part.msh");
}

TEST(Values, RangesRefuseNan) {
  Key key;
  EXPECT_THROW(key.check_range(std::numeric_limits<Real>::quiet_NaN()), InputError);
  key.lower = Limit{0, false};
  key.upper = Limit{1, true};
  EXPECT_EQ(key.range(), "(0, 1]");
  EXPECT_NO_THROW(key.check_range(1));
  EXPECT_NO_THROW(key.check_range(1e-300));
  for (const Real value : {0.0, -1.0, 1.1, std::numeric_limits<Real>::infinity(),
                           std::numeric_limits<Real>::quiet_NaN(), -std::numeric_limits<Real>::quiet_NaN()}) {
    EXPECT_THROW(key.check_range(value), InputError) << value;
  }
}

}  // namespace
}  // namespace malleus
