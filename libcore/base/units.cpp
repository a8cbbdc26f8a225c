#include "base/units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/error.hpp"
#include "base/text.hpp"

namespace malleus {
namespace {

using Powers = Dimension::Powers;
constexpr Real tolerance_of_powers = 1e-9;

bool is_near(const Powers& a, const Powers& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!(std::abs(a[i] - b[i]) <= tolerance_of_powers)) return false;
  }
  return true;
}

/// start + factor * direction.
Powers moved(const Powers& start, const Powers& direction, Real factor) {
  Powers result = start;
  for (std::size_t i = 0; i < start.size(); ++i) result[i] += factor * direction[i];
  return result;
}

/// The value of the one symbol of `wanted` that makes it the dimension `given`, if there is one.
std::optional<Real> solve_for_symbol(const Dimension& given, const Dimension& wanted) {
  const Powers& direction = wanted.symbolic.begin()->second;
  const auto largest =
      std::max_element(direction.begin(), direction.end(), [](Real a, Real b) { return std::abs(a) < std::abs(b); });
  if (*largest == 0) return {};
  const auto i = static_cast<std::size_t>(largest - direction.begin());
  const Real value = (given.powers[i] - wanted.powers[i]) / direction[i];
  if (!is_near(given.powers, moved(wanted.powers, direction, value))) return {};
  return value;
}

std::string example_of(const Unit& wanted) {
  return wanted.dimension.is_one() && wanted.text.empty() ? "no unit is allowed here"
                                                          : fmt::format("expected a unit like '{}'", wanted.text);
}

[[noreturn]] void refuse_dimension(std::string_view given_text, const Dimension& given, const Unit& wanted) {
  const std::string kind = name_of(given);
  throw InputError(fmt::format("unit '{}'{} does not fit, {}", given_text,
                               kind.empty() ? "" : fmt::format(" ({})", kind), example_of(wanted)));
}

/// Symbolic powers learnt from `given`; throws where it does not fit.
std::map<std::string, Real> match_dimension(const Unit& given, std::string_view given_text, const Unit& wanted) {
  const Dimension& have = given.dimension;
  const Dimension& want = wanted.dimension;
  if (have == want) return {};
  const bool one_symbol_each = have.symbolic.size() == 1 && want.symbolic.size() == 1;
  if (one_symbol_each && is_near(have.powers, want.powers) &&
      is_near(have.symbolic.begin()->second, want.symbolic.begin()->second)) {
    return {};
  }
  if (have.symbolic.empty() && want.symbolic.size() == 1) {
    if (const auto value = solve_for_symbol(have, want)) return {{want.symbolic.begin()->first, *value}};
  }
  refuse_dimension(given_text, have, wanted);
}

}  // namespace

bool Dimension::operator==(const Dimension& other) const {
  if (!is_near(powers, other.powers)) return false;
  const auto covers = [](const Dimension& a, const Dimension& b) {
    return std::all_of(a.symbolic.begin(), a.symbolic.end(), [&](const auto& entry) {
      const auto found = b.symbolic.find(entry.first);
      return is_near(entry.second, found == b.symbolic.end() ? Powers{} : found->second);
    });
  };
  return covers(*this, other) && covers(other, *this);
}

bool Dimension::is_one() const {
  return *this == Dimension{};
}

Quantity convert_to_si(Real value, std::string_view given, const Unit& wanted) {
  if (given.empty()) return {value, {}};
  const Unit unit = parse_unit(given);
  Quantity result;
  result.exponents = match_dimension(unit, given, wanted);
  const Real size = std::abs(value);
  constexpr Real largest = std::numeric_limits<Real>::max();
  if (unit.numerator > 1 && !(size <= largest / unit.numerator)) throw InputError("the number is too large");
  const Real product = value * unit.numerator;
  if (unit.denominator < 1 && !(std::abs(product) <= largest * unit.denominator)) {
    throw InputError("the number is too large");
  }
  result.value = product / unit.denominator + unit.offset;
  return result;
}

std::vector<Quantity> parse_quantities(std::string_view text, const Unit& wanted) {
  std::vector<Real> numbers;
  std::string_view rest = trim(text);
  while (!(rest.starts_with("1/") && !numbers.empty())) {  // the unit of `5 1/s` starts with a digit
    const auto number = take_real(rest);
    if (!number) break;
    numbers.push_back(*number);
    if (rest.starts_with(',')) {
      throw InputError(fmt::format("'{}' is not a number (the decimal sign is a point; blanks part a list)", text));
    }
    rest = trim(rest);
  }
  if (numbers.empty()) throw InputError(fmt::format("'{}' is not a finite number", text));
  std::vector<Quantity> result;
  for (const Real number : numbers) result.push_back(convert_to_si(number, rest, wanted));
  return result;
}

Quantity parse_quantity(std::string_view text, const Unit& wanted) {
  const auto quantities = parse_quantities(text, wanted);
  if (quantities.size() != 1) {
    throw InputError(fmt::format("'{}' holds {} numbers, expected one", text, quantities.size()));
  }
  return quantities.front();
}

std::string name_of(const Dimension& dimension) {
  static constexpr std::pair<std::string_view, std::string_view> names[] = {{"m", "length"},
                                                                            {"m2", "area"},
                                                                            {"m3", "volume"},
                                                                            {"s", "time"},
                                                                            {"kg", "mass"},
                                                                            {"K", "temperature"},
                                                                            {"m/s", "velocity"},
                                                                            {"m/s2", "acceleration"},
                                                                            {"1/s", "rate"},
                                                                            {"N", "force"},
                                                                            {"Pa", "pressure"},
                                                                            {"J", "energy"},
                                                                            {"W", "power"},
                                                                            {"Pa.s", "viscosity"},
                                                                            {"kg/m3", "density"},
                                                                            {"N/m3", "force per volume"},
                                                                            {"m3/s", "flow rate"},
                                                                            {"m2/s", "diffusivity"},
                                                                            {"W/m/K", "conductivity"},
                                                                            {"J/kg/K", "heat capacity"},
                                                                            {"W/m2/K", "heat transfer"},
                                                                            {"1/m", "per length"},
                                                                            {"B", "memory"},
                                                                            {"1", "number"}};
  for (const auto& [unit, name] : names) {
    if (parse_unit(unit).dimension == dimension) return std::string(name);
  }
  return {};
}

}  // namespace malleus
