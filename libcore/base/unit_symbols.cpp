#include "base/unit_symbols.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <numbers>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/text.hpp"

namespace malleus {
namespace {

using Powers = Dimension::Powers;

constexpr Powers one = {0, 0, 0, 0, 0};
constexpr Powers mass = {1, 0, 0, 0, 0};
constexpr Powers length = {0, 1, 0, 0, 0};
constexpr Powers duration = {0, 0, 1, 0, 0};
constexpr Powers temperature = {0, 0, 0, 1, 0};
constexpr Powers information = {0, 0, 0, 0, 1};
constexpr Powers volume = {0, 3, 0, 0, 0};
constexpr Powers frequency = {0, 0, -1, 0, 0};
constexpr Powers force = {1, 1, -2, 0, 0};
constexpr Powers pressure = {1, -1, -2, 0, 0};
constexpr Powers energy = {1, 2, -2, 0, 0};
constexpr Powers power = {1, 2, -3, 0, 0};
constexpr Powers viscosity = {1, -1, -1, 0, 0};
constexpr Powers diffusivity = {0, 2, -1, 0, 0};

/// The known symbols: SI (BIPM brochure, 9th ed.), the units accepted with it, and those met in forming shops.
constexpr UnitSymbol symbols[] = {
    {"kg", 1, 1, mass},
    {"g", 1, 1e3, mass},
    {"mg", 1, 1e6, mass},
    {"t", 1e3, 1, mass},
    {"m", 1, 1, length},
    {"km", 1e3, 1, length},
    {"dm", 1, 10, length},
    {"cm", 1, 100, length},
    {"mm", 1, 1e3, length},
    {"um", 1, 1e6, length},
    {"nm", 1, 1e9, length},
    {"in", 254, 1e4, length},
    {"s", 1, 1, duration},
    {"ms", 1, 1e3, duration},
    {"us", 1, 1e6, duration},
    {"min", 60, 1, duration},
    {"h", 3600, 1, duration},
    {"d", 86400, 1, duration},
    {"K", 1, 1, temperature},
    {"degC", 1, 1, temperature, 273.15},
    {"B", 1, 1, information},
    {"kB", 1e3, 1, information},
    {"MB", 1e6, 1, information},
    {"GB", 1e9, 1, information},
    {"TB", 1e12, 1, information},
    {"KiB", 1024, 1, information},
    {"MiB", 1048576, 1, information},
    {"GiB", 1073741824, 1, information},
    {"TiB", 1099511627776, 1, information},
    {"l", 1, 1e3, volume},
    {"L", 1, 1e3, volume},
    {"dl", 1, 1e4, volume},
    {"cl", 1, 1e5, volume},
    {"ml", 1, 1e6, volume},
    {"mL", 1, 1e6, volume},
    {"ul", 1, 1e9, volume},
    {"Hz", 1, 1, frequency},
    {"kHz", 1e3, 1, frequency},
    {"rpm", 2 * std::numbers::pi, 60, frequency},
    {"N", 1, 1, force},
    {"mN", 1, 1e3, force},
    {"kN", 1e3, 1, force},
    {"MN", 1e6, 1, force},
    {"tf", 9806.65, 1, force},
    {"Pa", 1, 1, pressure},
    {"hPa", 100, 1, pressure},
    {"kPa", 1e3, 1, pressure},
    {"MPa", 1e6, 1, pressure},
    {"GPa", 1e9, 1, pressure},
    {"bar", 1e5, 1, pressure},
    {"mbar", 100, 1, pressure},
    {"atm", 101325, 1, pressure},
    {"psi", 6894.757293168, 1, pressure},
    {"J", 1, 1, energy},
    {"mJ", 1, 1e3, energy},
    {"kJ", 1e3, 1, energy},
    {"MJ", 1e6, 1, energy},
    {"W", 1, 1, power},
    {"mW", 1, 1e3, power},
    {"kW", 1e3, 1, power},
    {"MW", 1e6, 1, power},
    {"P", 1, 10, viscosity},
    {"cP", 1, 1e3, viscosity},
    {"St", 1, 1e4, diffusivity},
    {"cSt", 1, 1e6, diffusivity},
    {"rad", 1, 1, one},
    {"deg", std::numbers::pi, 180, one},
    {"%", 1, 100, one},
};

}  // namespace

const UnitSymbol& find_unit_symbol(std::string_view name) {
  const auto* const found = std::find_if(std::begin(symbols), std::end(symbols),
                                         [&](const UnitSymbol& symbol) { return symbol.name == name; });
  if (found != std::end(symbols)) return *found;
  std::vector<std::string> known;
  for (const UnitSymbol& symbol : symbols) known.emplace_back(symbol.name);
  throw InputError(fmt::format("unknown unit '{}'{}", name, did_you_mean(name, known)));
}

}  // namespace malleus
