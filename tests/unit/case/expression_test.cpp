/// Formulas: values, folding, faults with their position, and results that are not finite.

#include "case/expression.hpp"

#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <numbers>

#include "base/error.hpp"

namespace malleus {
namespace {

std::string message_of(std::string_view text) {
  try {
    Expression::parse(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Expression, EvaluatesFormulas) {
  const Expression formula = Expression::parse("sin(pi*x)*y^2 + e^z - _pi*_e*t");
  const Real expected =
      std::sin(std::numbers::pi * 0.3) * 0.16 + std::exp(0.5) - std::numbers::pi * std::numbers::e * 2;
  EXPECT_NEAR(formula({0.3, 0.4, 0.5}, 2), expected, 1e-14);
  EXPECT_EQ(Expression::parse("x < 0.5 ? 1 : 2")({0.6, 0, 0}, 0), 2.0);
  EXPECT_EQ(Expression::parse("max(x, y, 3) + (x == 1) + (x >= 1) + (x != 1)")({1, 2, 0}, 0), 5.0);
  EXPECT_EQ(Expression::parse("sqrt(x) && y")({1, 2, 0}, 0), 1.0);
}

TEST(Expression, FoldsConstants) {
  EXPECT_TRUE(Expression::parse("2*pi").is_constant());
  EXPECT_EQ(Expression::parse("2*pi")({}, 0), 2 * std::numbers::pi);
  EXPECT_TRUE(Expression(3).is_constant());
  EXPECT_EQ(Expression()({}, 0), 0.0);
  EXPECT_FALSE(Expression::parse("0*x").is_constant());
}

TEST(Expression, KnowsWhatItDependsOn) {
  EXPECT_TRUE(Expression::parse("x+t").depends_on_time());
  EXPECT_TRUE(Expression::parse("x+t").depends_on_position());
  EXPECT_FALSE(Expression::parse("t").depends_on_position());
  EXPECT_FALSE(Expression::parse("z").depends_on_time());
  EXPECT_FALSE(Expression(1).depends_on_time() || Expression(1).depends_on_position());
}

TEST(Expression, EvaluatesManyPoints) {
  const Expression formula = Expression::parse("x + 10*y + 100*z + 1000*t");
  const std::array<Real, 6> coordinates = {1, 2, 3, 4, 5, 6};
  std::array<Real, 3> in_plane = {};
  formula.evaluate(coordinates, 2, 1, in_plane);
  EXPECT_EQ(in_plane, (std::array<Real, 3>{1021, 1043, 1065}));
  std::array<Real, 2> in_space = {};
  formula.evaluate(coordinates, 3, 1, in_space);
  EXPECT_EQ(in_space, (std::array<Real, 2>{1321, 1654}));
  Expression(7).evaluate(coordinates, 3, 1, in_space);
  EXPECT_EQ(in_space, (std::array<Real, 2>{7, 7}));
  formula.evaluate({}, 3, 1, {});
  EXPECT_THROW(formula.evaluate(coordinates, 3, 1, in_plane), Defect);
}

TEST(Expression, CopiesAgree) {
  const Expression formula = Expression::parse("x+1");
  const Expression copy = formula;
  EXPECT_EQ(formula({1, 0, 0}, 0), 2.0);
  EXPECT_EQ(copy({2, 0, 0}, 0), 3.0);
  EXPECT_EQ(formula({1, 0, 0}, 0), 2.0);
}

TEST(Expression, ResultsMayBeNotFiniteWithoutTrap) {
  EXPECT_TRUE(std::isinf(Expression::parse("1/x")({0, 0, 0}, 0)));
  EXPECT_TRUE(std::isnan(Expression::parse("sqrt(x)")({-1, 0, 0}, 0)));
  EXPECT_TRUE(std::isinf(Expression::parse("exp(x)")({1e5, 0, 0}, 0)));
  EXPECT_NE(fegetexcept() & FE_INVALID, 0) << "traps must be on again";
  EXPECT_EQ(std::fetestexcept(FE_INVALID | FE_DIVBYZERO), 0);
}

TEST(Expression, FiniteValuesAreDemandedWithThePlace) {
  Expression formula = Expression::parse("1/(x-y)");
  formula.set_source("test.ini:3: [body_force] x");
  EXPECT_EQ(formula.finite_at({3, 1, 0}, 0), 0.5);
  try {
    formula.finite_at({1, 1, 2}, 0.5);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "test.ini:3: [body_force] x: expression '1/(x-y)' gives inf at (1, 1, 2) m, t = 0.5 s");
  }
  const std::array<Real, 6> coordinates = {3, 1, 2, 1, 5, 5};
  std::array<Real, 3> values = {};
  EXPECT_NO_THROW(formula.evaluate_finite(std::span(coordinates).first(4), 2, 0, std::span(values).first(2)));
  EXPECT_EQ(values[1], 1.0);
  EXPECT_THROW(formula.evaluate_finite(coordinates, 2, 0, values), InputError);
}

TEST(Expression, FaultsNameTheirPosition) {
  EXPECT_EQ(message_of("2*sx"), "expression '2*sx' is not understood at letter 3: unknown 'sx'; did you mean 'x'?");
  EXPECT_NE(message_of("1 + wrong(x)").find("at letter 5: unknown 'wrong'"), std::string::npos);
  EXPECT_NE(message_of("x = 3").find("at letter 3: '=' assigns"), std::string::npos);
  EXPECT_NE(message_of("1, 2").find("at letter 2: ','"), std::string::npos);
  EXPECT_NE(message_of("(x"), "");
  EXPECT_NE(message_of("x)"), "");
  EXPECT_NE(message_of("x +"), "");
  EXPECT_NE(message_of("sin"), "");
  EXPECT_NE(message_of("sin(x, y)"), "");
  EXPECT_NE(message_of("\"x\""), "");
  EXPECT_NE(message_of("1/0").find("no finite number"), std::string::npos);
  EXPECT_NE(message_of("sqrt(-1)").find("no finite number"), std::string::npos);
  EXPECT_EQ(message_of("  "), "an empty expression");
  EXPECT_NE(message_of(std::string(5000, '1')).find("at most 4000"), std::string::npos);
  EXPECT_NE(message_of(std::string(1000, '(')).find("nested too deep"), std::string::npos);
}

}  // namespace
}  // namespace malleus
