#include "case/expression.hpp"

#include <fmt/format.h>
#include <muParser.h>

#include <algorithm>
#include <cfenv>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.hpp"
#include "base/text.hpp"

namespace malleus {
namespace {

constexpr std::size_t longest_formula = 4000;
constexpr int deepest_nesting = 100;

/// Formulas may divide by zero: their results are tested afterwards, so traps rest meanwhile.
class TrapsAtRest {
 public:
  TrapsAtRest() { std::feholdexcept(&environment_); }
  TrapsAtRest(const TrapsAtRest&) = delete;
  TrapsAtRest& operator=(const TrapsAtRest&) = delete;
  ~TrapsAtRest() { std::fesetenv(&environment_); }

 private:
  std::fenv_t environment_ = {};
};

std::string fault_at(std::string_view text, std::size_t position, std::string_view what) {
  return fmt::format("expression '{}' is not understood at letter {}: {}", text, position + 1, what);
}

/// muParser takes `x = 3` for an assignment and `1, 2` for two formulas; neither has a meaning here.
void refuse_foreign_syntax(std::string_view text) {
  if (text.size() > longest_formula) {
    throw InputError(fmt::format("expression of {} letters; at most {} are allowed", text.size(), longest_formula));
  }
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char before = i > 0 ? text[i - 1] : ' ';
    const char after = i + 1 < text.size() ? text[i + 1] : ' ';
    const bool compares = before == '=' || before == '<' || before == '>' || before == '!' || after == '=';
    if (text[i] == '=' && !compares) throw InputError(fault_at(text, i, "'=' assigns; compare with '=='"));
    if (text[i] == ',' && depth == 0) throw InputError(fault_at(text, i, "',' outside a function's arguments"));
    if (text[i] == '"') throw InputError(fault_at(text, i, "a quote"));
    if (text[i] == '(') ++depth;
    if (text[i] == ')') --depth;
    if (depth > deepest_nesting) throw InputError(fault_at(text, i, "parentheses nested too deep"));
  }
}

}  // namespace

/// The compiled text and the variables it reads.
class Expression::Formula {
 public:
  /// The variables are x, y, z, t, or T alone, which stands in the place of x.
  Formula(const std::string& text, bool is_of_temperature) {
    if (is_of_temperature) {
      variables_ = {"T"};
      parser_.DefineVar("T", &x_);
    } else {
      parser_.DefineVar("x", &x_);
      parser_.DefineVar("y", &y_);
      parser_.DefineVar("z", &z_);
      parser_.DefineVar("t", &t_);
    }
    // muParser's own _pi has but twelve digits after the point.
    for (const char* name : {"pi", "_pi"}) parser_.DefineConst(name, std::numbers::pi);
    for (const char* name : {"e", "_e"}) parser_.DefineConst(name, std::numbers::e);
    parser_.SetExpr(text);
    try {
      parser_.Eval();
      for (const auto& [name, address] : parser_.GetUsedVar()) (name == "t" ? uses_time_ : uses_position_) = true;
    } catch (const mu::Parser::exception_type& error) {
      throw InputError(describe(text, error));
    }
  }

  Real value(Real x, Real y, Real z, Real t) {
    x_ = x;
    y_ = y;
    z_ = z;
    t_ = t;
    return parser_.Eval();
  }

  bool uses_position() const { return uses_position_; }
  bool uses_time() const { return uses_time_; }

 private:
  std::string describe(const std::string& text, const mu::Parser::exception_type& error) const {
    const bool is_placed = error.GetPos() >= 0 && static_cast<std::size_t>(error.GetPos()) <= text.size();
    const std::size_t position = is_placed ? static_cast<std::size_t>(error.GetPos()) : 0;
    const std::string& token = error.GetToken();
    if (error.GetCode() != mu::ecUNASSIGNABLE_TOKEN) return fault_at(text, position, error.GetMsg());
    std::vector<std::string> known = variables_;
    for (const auto& [name, value] : parser_.GetConst()) known.push_back(name);
    for (const auto& [name, function] : parser_.GetFunDef()) known.push_back(name);
    const std::string hint = did_you_mean(token, known);
    const std::string names =
        fmt::format("; known are {}, pi, e and muParser's functions", fmt::join(variables_, ", "));
    const std::string allowed = hint.empty() ? names : hint;
    return fault_at(text, position, fmt::format("unknown '{}'{}", token, allowed));
  }

  mu::Parser parser_;
  std::vector<std::string> variables_ = {"x", "y", "z", "t"};
  Real x_ = 0;
  Real y_ = 0;
  Real z_ = 0;
  Real t_ = 0;
  bool uses_position_ = false;
  bool uses_time_ = false;
};

Expression::Expression(Real constant) : text_(format_real(constant)), constant_(constant) {}

Expression Expression::parse(std::string_view text) {
  return compile(text, false);
}

Expression Expression::parse_of_temperature(std::string_view text) {
  return compile(text, true);
}

Expression Expression::compile(std::string_view text, bool is_of_temperature) {
  const std::string formula_text(trim(text));
  if (formula_text.empty()) throw InputError("an empty expression");
  refuse_foreign_syntax(formula_text);
  const TrapsAtRest rest;
  const auto formula = std::make_shared<Formula>(formula_text, is_of_temperature);
  Expression result;
  result.text_ = formula_text;
  if (formula->uses_position() || formula->uses_time()) {
    result.formula_ = formula;
    return result;
  }
  result.constant_ = formula->value(0, 0, 0, 0);
  if (!std::isfinite(result.constant_)) {
    throw InputError(fmt::format("expression '{}' gives no finite number", formula_text));
  }
  return result;
}

bool Expression::depends_on_position() const {
  return formula_ != nullptr && formula_->uses_position();
}

bool Expression::depends_on_time() const {
  return formula_ != nullptr && formula_->uses_time();
}

Real Expression::operator()(const std::array<Real, 3>& point, Real time) const {
  if (formula_ == nullptr) return constant_;
  const TrapsAtRest rest;
  return formula_->value(point[0], point[1], point[2], time);
}

void Expression::evaluate(std::span<const Real> coordinates, int dimension, Real time, std::span<Real> values) const {
  check(dimension >= 1 && dimension <= 3, "expressions are of one to three coordinates");
  const auto stride = static_cast<std::size_t>(dimension);
  check(coordinates.size() == values.size() * stride, "coordinates and values of an expression do not match");
  if (formula_ == nullptr) {
    std::fill(values.begin(), values.end(), constant_);
    return;
  }
  const TrapsAtRest rest;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Real* point = coordinates.data() + i * stride;
    values[i] = formula_->value(point[0], stride > 1 ? point[1] : 0, stride > 2 ? point[2] : 0, time);
  }
}

void Expression::refuse_value(const std::array<Real, 3>& point, Real time, Real value) const {
  throw InputError(fmt::format("{}expression '{}' gives {} at ({:.6g}, {:.6g}, {:.6g}) m, t = {:.6g} s",
                               source_.empty() ? "" : source_ + ": ", text_, value, point[0], point[1], point[2],
                               time));
}

Real Expression::finite_at(const std::array<Real, 3>& point, Real time) const {
  const Real value = (*this)(point, time);
  if (!std::isfinite(value)) refuse_value(point, time, value);
  return value;
}

Real Expression::at_temperature(Real temperature) const {
  const Real value = (*this)({temperature, 0, 0}, 0);
  if (std::isfinite(value)) return value;
  throw InputError(fmt::format("{}expression '{}' gives {} at T = {:.6g} K", source_.empty() ? "" : source_ + ": ",
                               text_, value, temperature));
}

void Expression::evaluate_finite(std::span<const Real> coordinates, int dimension, Real time,
                                 std::span<Real> values) const {
  evaluate(coordinates, dimension, time, values);
  const auto wrong = std::find_if(values.begin(), values.end(), [](Real value) { return !std::isfinite(value); });
  if (wrong == values.end()) return;
  const auto first = static_cast<std::size_t>(wrong - values.begin()) * static_cast<std::size_t>(dimension);
  std::array<Real, 3> point = {};
  std::copy_n(coordinates.begin() + static_cast<std::ptrdiff_t>(first), dimension, point.begin());
  refuse_value(point, time, *wrong);
}

}  // namespace malleus
