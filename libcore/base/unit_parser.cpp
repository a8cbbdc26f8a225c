#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "base/text.hpp"
#include "base/unit_symbols.hpp"
#include "base/units.hpp"

namespace malleus {
namespace {

using Powers = Dimension::Powers;
constexpr std::size_t longest_unit = 80;  // also bounds the depth of nested parentheses
constexpr Real largest_power = 12;
constexpr Real largest_magnitude = 140;  // decimal digits of a factor: products of two stay finite

Powers scaled(const Powers& a, Real factor) {
  Powers result = a;
  for (Real& value : result) value *= factor;
  return result;
}

Powers added(const Powers& a, const Powers& b) {
  Powers result = a;
  for (std::size_t i = 0; i < a.size(); ++i) result[i] += b[i];
  return result;
}

/// What stands behind ^: a number plus multiples of symbols.
struct Exponent {
  Real number = 0;
  std::map<std::string, Real> symbols;
};

Exponent scaled(Exponent exponent, Real factor) {
  exponent.number *= factor;
  for (auto& [name, multiple] : exponent.symbols) multiple *= factor;
  return exponent;
}

Real power_of_factor(Real base, Real exponent, std::string_view text) {
  const bool in_range = std::abs(exponent * std::log10(base)) < largest_magnitude;
  if (!in_range) throw InputError(fmt::format("unit '{}' is out of range", text));
  return std::pow(base, exponent);
}

Real product_of_factors(Real a, Real b, std::string_view text) {
  const bool in_range = std::abs(std::log10(a) + std::log10(b)) < largest_magnitude;
  if (!in_range) throw InputError(fmt::format("unit '{}' is out of range", text));
  return a * b;
}

/// Recursive descent over one unit text.
class UnitParser {
 public:
  explicit UnitParser(std::string_view text) : text_(text), rest_(text) {}

  Unit parse() {
    Unit unit = product();
    if (!rest_.empty()) fail();
    unit.text = text_;
    return unit;
  }

 private:
  [[noreturn]] void fail() const {
    const std::size_t position = text_.size() - rest_.size();
    const std::string what = rest_.empty() ? "it ends too early" : fmt::format("unexpected '{}'", rest_.substr(0, 8));
    throw InputError(fmt::format("unit '{}' is not understood at letter {}: {}", text_, position + 1, what));
  }

  void skip_blanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  bool take(char letter) {
    if (rest_.empty() || rest_.front() != letter) return false;
    rest_.remove_prefix(1);
    return true;
  }

  Unit product() {
    Unit result = rest_.starts_with('/') ? Unit{} : factor();  // `2.5 /s` is 2.5 1/s
    for (skip_blanks(); !rest_.empty() && rest_.front() != ')'; skip_blanks()) {
      const bool divide = take('/');
      if (!divide && !take('*')) take('.');
      skip_blanks();
      Unit next = factor();
      result.offset = 0;
      multiply(result, next, divide ? -1 : 1);
    }
    return result;
  }

  Unit factor() {
    Unit unit;
    if (take('(')) {
      unit = product();
      if (!take(')')) fail();
    } else if (!take('1')) {
      unit = symbol();
    }
    Exponent exponent;
    if (!take_exponent(exponent)) return unit;
    return raised(unit, exponent);
  }

  Unit symbol() {
    std::size_t size = 0;
    while (size < rest_.size() && (std::isalpha(static_cast<unsigned char>(rest_[size])) != 0 || rest_[size] == '%')) {
      ++size;
    }
    if (size == 0) fail();
    const std::string_view name = rest_.substr(0, size);
    const UnitSymbol& known = find_unit_symbol(name);
    rest_.remove_prefix(size);
    return {known.numerator, known.denominator, known.offset, {known.powers, {}}, std::string(name)};
  }

  bool take_exponent(Exponent& exponent) {
    const bool marked = take('^');
    if (!marked && (rest_.empty() || rest_.front() < '0' || rest_.front() > '9')) return false;
    if (marked && take('(')) {
      exponent = sum_of_terms();
      if (!take(')')) fail();
    } else {
      const Real sign = marked && take('-') ? -1 : 1;
      exponent = scaled(term(), sign);
    }
    return true;
  }

  Exponent sum_of_terms() {
    Exponent sum;
    Real sign = take('-') ? -1 : 1;
    while (true) {
      const Exponent next = term();
      sum.number += sign * next.number;
      for (const auto& [name, multiple] : next.symbols) sum.symbols[name] += sign * multiple;
      if (take('+')) {
        sign = 1;
      } else if (take('-')) {
        sign = -1;
      } else {
        return sum;
      }
    }
  }

  /// A number, or a symbol. A dot belongs to the number where a digit follows: `s^0.3`, but `m^2.s`.
  Exponent term() {
    std::size_t size = 0;
    const auto is = [&](int (*kind)(int)) {
      return size < rest_.size() && kind(static_cast<unsigned char>(rest_[size])) != 0;
    };
    while (is(std::isdigit)) ++size;
    if (size > 0 && size + 1 < rest_.size() && rest_[size] == '.' && rest_[size + 1] >= '0' && rest_[size + 1] <= '9') {
      ++size;
      while (is(std::isdigit)) ++size;
    }
    Exponent result;
    if (size > 0) {
      std::string_view digits = rest_.substr(0, size);
      result.number = take_real(digits).value_or(largest_power + 1);
      if (!(result.number <= largest_power)) throw InputError(fmt::format("unit '{}' is out of range", text_));
    } else {
      while (is(std::isalpha)) ++size;
      if (size == 0) fail();
      result.symbols[std::string(rest_.substr(0, size))] = 1;
    }
    rest_.remove_prefix(size);
    return result;
  }

  Unit raised(const Unit& unit, const Exponent& exponent) const {
    const bool coherent = unit.numerator == 1 && unit.denominator == 1;
    const bool plain = unit.dimension.symbolic.empty();
    if (!exponent.symbols.empty() && !(coherent && plain)) {
      throw InputError(fmt::format(
          "in unit '{}' what is raised to a symbol must be an SI unit of factor one (s^m, not min^m)", text_));
    }
    Unit result;
    result.numerator = power_of_factor(unit.numerator, exponent.number, text_);
    result.denominator = power_of_factor(unit.denominator, exponent.number, text_);
    result.dimension.powers = scaled(unit.dimension.powers, exponent.number);
    for (const auto& [name, powers] : unit.dimension.symbolic) {
      result.dimension.symbolic[name] = scaled(powers, exponent.number);
    }
    for (const auto& [name, multiple] : exponent.symbols) {
      result.dimension.symbolic[name] = scaled(unit.dimension.powers, multiple);
    }
    return result;
  }

  void multiply(Unit& result, const Unit& next, int sign) const {
    const Real up = sign > 0 ? next.numerator : next.denominator;
    const Real down = sign > 0 ? next.denominator : next.numerator;
    result.numerator = product_of_factors(result.numerator, up, text_);
    result.denominator = product_of_factors(result.denominator, down, text_);
    result.dimension.powers = added(result.dimension.powers, scaled(next.dimension.powers, sign));
    for (const auto& [name, powers] : next.dimension.symbolic) {
      result.dimension.symbolic[name] = added(result.dimension.symbolic[name], scaled(powers, sign));
    }
  }

  std::string_view text_;
  std::string_view rest_;
};

/// Writing habits that mean the same.
std::string in_plain_letters(std::string_view text) {
  static constexpr std::pair<std::string_view, std::string_view> habits[] = {
      {"\u00b0C", "degC"}, {"\u00b2", "2"}, {"\u00b3", "3"},   {"\u00b7", "."}, {"\u22c5", "."},
      {"\u00b5", "u"},     {"\u03bc", "u"}, {"\u00b0", "deg"}, {"**", "^"}};
  std::string plain(text);
  for (const auto& [habit, letters] : habits) {
    for (std::size_t at = plain.find(habit); at != std::string::npos; at = plain.find(habit, at + letters.size())) {
      plain.replace(at, habit.size(), letters);
    }
  }
  return plain;
}

}  // namespace

Unit parse_unit(std::string_view text) {
  const std::string plain = in_plain_letters(trim(text));
  if (plain.empty()) return {};
  if (plain.size() > longest_unit) throw InputError(fmt::format("unit '{}...' is too long", plain.substr(0, 20)));
  return UnitParser(plain).parse();
}

}  // namespace malleus
