/// The table of units, their algebra, and what is refused.

#include "base/units.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <span>

#include "base/error.hpp"

namespace malleus {
namespace {

struct Conversion {
  std::string_view text;
  std::string_view wanted;
  Real value;
};

void expect_exact(std::span<const Conversion> conversions) {
  for (const Conversion& c : conversions) {
    EXPECT_EQ(parse_quantity(c.text, parse_unit(c.wanted)).value, c.value) << c.text;
  }
}

std::string message_of(std::string_view text, std::string_view wanted) {
  try {
    parse_quantity(text, parse_unit(wanted));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Units, KnowsTheTable) {
  // Each symbol with its value in SI (BIPM brochure, 9th ed., tables 4, 7, 8; IEC 80000-13 for bytes).
  const std::vector<Conversion> table = {{"1 kg", "kg", 1},
                                         {"1 g", "kg", 1e-3},
                                         {"1 mg", "kg", 1e-6},
                                         {"1 t", "kg", 1e3},
                                         {"1 m", "m", 1},
                                         {"1 km", "m", 1e3},
                                         {"1 dm", "m", 0.1},
                                         {"1 cm", "m", 0.01},
                                         {"1 mm", "m", 1e-3},
                                         {"1 um", "m", 1e-6},
                                         {"1 nm", "m", 1e-9},
                                         {"1 in", "m", 0.0254},
                                         {"1 s", "s", 1},
                                         {"1 ms", "s", 1e-3},
                                         {"1 us", "s", 1e-6},
                                         {"1 min", "s", 60},
                                         {"1 h", "s", 3600},
                                         {"1 d", "s", 86400},
                                         {"1 K", "K", 1},
                                         {"1 B", "B", 1},
                                         {"1 kB", "B", 1e3},
                                         {"1 MB", "B", 1e6},
                                         {"1 GB", "B", 1e9},
                                         {"1 TB", "B", 1e12},
                                         {"1 KiB", "B", 1024},
                                         {"1 MiB", "B", 1048576},
                                         {"1 GiB", "B", 1073741824},
                                         {"1 TiB", "B", 1099511627776},
                                         {"1 l", "m^3", 1e-3},
                                         {"1 L", "m^3", 1e-3},
                                         {"1 dl", "m^3", 1e-4},
                                         {"1 cl", "m^3", 1e-5},
                                         {"1 ml", "m^3", 1e-6},
                                         {"1 mL", "m^3", 1e-6},
                                         {"1 ul", "m^3", 1e-9},
                                         {"1 Hz", "1/s", 1},
                                         {"1 kHz", "1/s", 1e3},
                                         {"1 rpm", "rad/s", 2 * std::numbers::pi / 60},
                                         {"1 N", "N", 1},
                                         {"1 mN", "N", 1e-3},
                                         {"1 kN", "N", 1e3},
                                         {"1 MN", "N", 1e6},
                                         {"1 tf", "N", 9806.65},
                                         {"1 Pa", "Pa", 1},
                                         {"1 hPa", "Pa", 100},
                                         {"1 kPa", "Pa", 1e3},
                                         {"1 MPa", "Pa", 1e6},
                                         {"1 GPa", "Pa", 1e9},
                                         {"1 bar", "Pa", 1e5},
                                         {"1 mbar", "Pa", 100},
                                         {"1 atm", "Pa", 101325},
                                         {"1 psi", "Pa", 6894.757293168},
                                         {"1 J", "J", 1},
                                         {"1 mJ", "J", 1e-3},
                                         {"1 kJ", "J", 1e3},
                                         {"1 MJ", "J", 1e6},
                                         {"1 W", "W", 1},
                                         {"1 mW", "W", 1e-3},
                                         {"1 kW", "W", 1e3},
                                         {"1 MW", "W", 1e6},
                                         {"1 P", "Pa.s", 0.1},
                                         {"1 cP", "Pa.s", 1e-3},
                                         {"1 St", "m^2/s", 1e-4},
                                         {"1 cSt", "m^2/s", 1e-6},
                                         {"1 rad", "", 1},
                                         {"180 deg", "rad", std::numbers::pi},
                                         {"50 %", "", 0.5}};
  expect_exact(table);
}

TEST(Units, ReadsQuantitiesOfCaseFiles) {
  const std::vector<Conversion> conversions = {{"179.2 MPa", "Pa", 179.2e6},
                                               {"5 mm/s", "m/s", 5e-3},
                                               {"7 mm", "m", 7e-3},
                                               {"10 Pa.s", "Pa.s", 10},
                                               {"10 Pa*s", "Pa.s", 10},
                                               {"10 Pa s", "Pa.s", 10},
                                               {"10 N.s/m2", "Pa.s", 10},
                                               {"300 mm/min", "m/s", 5e-3},
                                               {"20 degC", "K", 293.15},
                                               {"20 \u00b0C", "K", 293.15},
                                               {"-273.15 degC", "K", 0},
                                               {"7850 kg/m3", "kg/m^3", 7850},
                                               {"7.85 g/cm^3", "kg/m^3", 7850},
                                               {"7.85 t/m\u00b3", "kg/m^3", 7850},
                                               {"9.81 N/m^3", "kg/m2/s2", 9.81},
                                               {"1.2 W/m/K", "W/m/K", 1.2},
                                               {"1.2 W/(m.K)", "W/m/K", 1.2},
                                               {"1.2 W/(m K)", "W/m/K", 1.2},
                                               {"1.2 W.m^-1.K^-1", "W/m/K", 1.2},
                                               {"460 J/kg/degC", "J/kg/K", 460},
                                               {"2 kW/m^2/K", "W/m2/K", 2000},
                                               {"6 cm3/s", "m^3/s", 6e-6},
                                               {"6 l/min", "m^3/s", 1e-4},
                                               {"30 rpm", "rad/s", std::numbers::pi},
                                               {"2.5 1/s", "1/s", 2.5},
                                               {"2.5 s^-1", "1/s", 2.5},
                                               {"2.5/s", "1/s", 2.5},
                                               {"3 N/mm2", "Pa", 3e6},
                                               {"4 (m/s)^2", "J/kg", 4},
                                               {"2 MPa^0.5", "Pa^0.5", 2e3},
                                               {"1e3", "Pa", 1e3},
                                               {"+.5 mm", "m", 5e-4},
                                               {"5 um", "m", 5e-6},
                                               {"5 \u00b5m", "m", 5e-6}};
  for (const Conversion& c : conversions) {
    EXPECT_DOUBLE_EQ(parse_quantity(c.text, parse_unit(c.wanted)).value, c.value) << c.text;
  }
}

TEST(Units, DecimalPrefixesAreExact) {
  const std::vector<Conversion> conversions = {
      {"3 mm", "m", 3e-3}, {"7 mm", "m", 7e-3}, {"0.3 mm", "m", 3e-4}, {"1.1 g", "kg", 1.1e-3}, {"9 cm3", "m^3", 9e-6}};
  expect_exact(conversions);
}

TEST(Units, SymbolicPowersMatch) {
  const Unit consistency = parse_unit("Pa.s^m");
  EXPECT_EQ(parse_quantity("179.2 MPa.s^m", consistency).value, 179.2e6);
  EXPECT_EQ(parse_quantity("179.2 MPa.s^n", consistency).value, 179.2e6);
  EXPECT_TRUE(parse_quantity("179.2 MPa.s^m", consistency).exponents.empty());
  EXPECT_DOUBLE_EQ(parse_quantity("179.2 MPa.s^0.3", consistency).exponents.at("m"), 0.3);
  EXPECT_DOUBLE_EQ(parse_quantity("179.2 MPa.s", consistency).exponents.at("m"), 1);
  EXPECT_DOUBLE_EQ(parse_quantity("179.2 MPa", consistency).exponents.at("m"), 0);
  EXPECT_THROW(parse_quantity("179.2 MPa.min^m", consistency), InputError);
  EXPECT_THROW(parse_quantity("179.2 MPa.s^m.m", consistency), InputError);
  EXPECT_THROW(parse_quantity("179.2 mm/s", consistency), InputError);
  const Unit friction = parse_unit("s^(q-m).m^-q");
  EXPECT_EQ(parse_quantity("300 s^(q-m) m^-q", friction).value, 300);
  EXPECT_EQ(parse_quantity("300 s^(-m+q)/m^q", friction).value, 300);
  EXPECT_EQ(parse_quantity("300", friction).value, 300);
  EXPECT_THROW(parse_quantity("0.3 s^(q-m).mm^-q", friction), InputError);
  EXPECT_THROW(parse_quantity("0.3 s^(q+m).m^-q", friction), InputError);
}

TEST(Units, DimensionsOfSymbolsThatCancelAreOne) {
  EXPECT_TRUE(parse_unit("s^m/s^m").dimension.is_one());
  EXPECT_TRUE(parse_unit("N/(kg.m/s2)").dimension.is_one());
  EXPECT_FALSE(parse_unit("s^m").dimension.is_one());
}

TEST(Units, SaysWhatIsWrong) {
  EXPECT_EQ(message_of("179.2 mm/s", "Pa.s^m"), "unit 'mm/s' (velocity) does not fit, expected a unit like 'Pa.s^m'");
  EXPECT_EQ(message_of("3 Mpa", "Pa"), "unknown unit 'Mpa'; did you mean 'MPa'?");
  EXPECT_EQ(message_of("3 mm", ""), "unit 'mm' (length) does not fit, no unit is allowed here");
  EXPECT_EQ(message_of("1,5 mm", "m"), "'1,5 mm' is not a number (the decimal sign is a point; blanks part a list)");
  EXPECT_EQ(message_of("1 2 mm", "m"), "'1 2 mm' holds 2 numbers, expected one");
  EXPECT_EQ(message_of("nan", "m"), "'nan' is not a finite number");
  EXPECT_EQ(message_of("1e400 m", "m"), "'1e400 m' is not a finite number");
  EXPECT_EQ(message_of("1e308 km", "m"), "the number is too large");
  EXPECT_EQ(message_of("1 m^", "m"), "unit 'm^' is not understood at letter 3: it ends too early");
  EXPECT_EQ(message_of("1 m^99", "m"), "unit 'm^99' is out of range");
  EXPECT_EQ(message_of("1 (m", "m"), "unit '(m' is not understood at letter 3: it ends too early");
  EXPECT_EQ(message_of("1 m)", "m"), "unit 'm)' is not understood at letter 2: unexpected ')'");
}

TEST(Units, RefusesWhatIsNoUnitWithoutTrap) {
  for (const std::string_view unit :
       {"km^12.km^12.km^12.km^12.km^12.km^12.km^12.km^12", "TB^12.TB^12", "(((((m", "m//s", "m/", "^2", "2", "m^m^m",
        "m^(m", "m^()", "m^-", "m^.5", "\xff\xfe", "m\ts\t"}) {
    const std::string text = "1 " + std::string(unit);
    EXPECT_THROW(parse_quantity(text, parse_unit("Pa")), InputError) << unit;
  }
  EXPECT_THROW(parse_unit(std::string(1000, '(')), InputError);
}

TEST(Units, ReadsListsWithOneUnit) {
  const auto values = parse_quantities("0 0 -1 mm/s", parse_unit("m/s"));
  ASSERT_EQ(values.size(), 3U);
  EXPECT_EQ(values[2].value, -1e-3);
  EXPECT_EQ(parse_quantities("1 2 1/s", parse_unit("1/s")).size(), 2U);
  EXPECT_THROW(parse_quantities("0 mm 0 mm", parse_unit("m")), InputError);
  EXPECT_THROW(parse_quantities("", parse_unit("m")), InputError);
}

}  // namespace
}  // namespace malleus
