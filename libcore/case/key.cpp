#include "case/key.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/error.hpp"
#include "base/text.hpp"

namespace malleus {

std::string Key::range() const {
  if (!lower && !upper) return {};
  const std::string from = !lower ? "(-inf" : (lower->is_included ? "[" : "(") + format_real(lower->value);
  const std::string to = !upper ? "inf)" : format_real(upper->value) + (upper->is_included ? "]" : ")");
  return from + ", " + to;
}

void Key::check_range(Real value) const {
  // NaN first: even to compare it would raise a floating-point exception.
  const auto is_inside = [&] {
    const bool is_high_enough = !lower || (lower->is_included ? value >= lower->value : value > lower->value);
    const bool is_low_enough = !upper || (upper->is_included ? value <= upper->value : value < upper->value);
    return is_high_enough && is_low_enough;
  };
  if (std::isfinite(value) && is_inside()) return;
  throw InputError(fmt::format("{} is outside {}{}", format_real(value), range().empty() ? "(-inf, inf)" : range(),
                               unit.empty() ? "" : fmt::format(" {}", unit)));
}

std::string Key::allowed() const {
  std::string result = type;
  if (!unit.empty()) result += ", " + unit;
  if (!range().empty()) result += " in " + range();
  if (!empty_word.empty()) result += ", or " + empty_word;
  return result;
}

std::string fault_of_exponents(const Key& key, std::string_view name, Real value) {
  for (const auto& [symbol, found] : key.exponents) {
    if (!(std::abs(found - value) <= 1e-9)) {
      return fmt::format("the unit's power says {} = {:.9g}, but {} = {:.9g}", symbol, found, name, value);
    }
  }
  return {};
}

}  // namespace malleus
