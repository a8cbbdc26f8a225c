#pragma once

/// The table of unit symbols that input may use.

#include <string_view>

#include "base/units.hpp"

namespace malleus {

/// SI value = value * numerator / denominator + offset.
struct UnitSymbol {
  std::string_view name;
  Real numerator;
  Real denominator;
  Dimension::Powers powers;
  Real offset = 0;
};

/// Throws InputError with the nearest known symbol where there is no such one. Local.
const UnitSymbol& find_unit_symbol(std::string_view name);

}  // namespace malleus
