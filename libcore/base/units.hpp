#pragma once

/// Physical units of input: `179.2 MPa`, `300 mm/min`, `20 degC`, `1.2 W/(m2 K)`, `10 Pa.s`, `179.2 MPa.s^m`.
///
/// A unit is a product of known symbols with powers: apart by `.`, `*`, a blank, or `/`; powers as `m^2`, `m2`, `s^-1`,
/// `s^0.3`; parentheses group; evaluated from the left (`a/b.c` is (a/b) c). `degC` has its offset alone and is a
/// difference inside a product. A power may hold symbols, as the consistency's s^m does, or s^(q-m): what is raised to
/// them must then be a unit of factor one. All local.

#include <array>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// Powers of kg, m, s, K and byte: a number each, plus a multiple of each named symbol (Pa.s^m: kg m^-1 s^-2, and 1 m
/// on s).
struct Dimension {
  static constexpr int n_bases = 5;
  using Powers = std::array<Real, n_bases>;
  Powers powers = {};
  std::map<std::string, Powers> symbolic;

  bool operator==(const Dimension& other) const;
  bool is_one() const;
};

/// SI value = value * numerator / denominator + offset. Two factors, so that 5 mm is exactly the double 0.005.
struct Unit {
  Real numerator = 1;
  Real denominator = 1;
  Real offset = 0;
  Dimension dimension;
  std::string text;  ///< as it was written
};

/// A number in SI and what was learnt of symbolic powers: `179.2 MPa.s^0.3` where Pa.s^m was wanted gives m = 0.3.
struct Quantity {
  Real value = 0;
  std::map<std::string, Real> exponents;
};

/// Throws InputError (what is not understood, and the nearest known symbol). Empty text is the unit one.
Unit parse_unit(std::string_view text);

/// value [unit] -> SI. A bare number is SI. Throws InputError where it is no finite number, the unit is not known, its
/// dimension is not that of `wanted`, or the value overflows. Of a single symbolic power the symbol's name is free, and
/// a number may stand for it.
Quantity parse_quantity(std::string_view text, const Unit& wanted);

/// The numbers at the start of `text` (one or more), with the unit that follows them. Throws as parse_quantity does.
std::vector<Quantity> parse_quantities(std::string_view text, const Unit& wanted);

/// `value` given in `given` (empty: SI) for a key that wants `wanted`. Throws as parse_quantity does.
Quantity convert_to_si(Real value, std::string_view given, const Unit& wanted);

/// "pressure", "velocity", ...; empty where the dimension has no common name.
std::string name_of(const Dimension& dimension);

}  // namespace malleus
