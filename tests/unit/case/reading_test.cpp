/// A case read whole: values, defaults, origins and every kind of mistake.

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "case/schema.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

enum class Law { norton_hoff, newtonian, rigid };

struct Body {
  std::string name;
  std::string group;
  Law law = Law::norton_hoff;
  Real consistency = 0;
  Real rate_sensitivity = 1;
  std::optional<Real> density;
  std::string against;

  void describe(Section& s) {
    s.string("group", group, "physical volume").required().starter("billet").names_volume_group();
    s.choice("law", law, {{"norton-hoff", Law::norton_hoff}, {"newtonian", Law::newtonian}, {"rigid", Law::rigid}},
             "how it deforms");
    s.real("rate_sensitivity", rate_sensitivity, "", "m").above(0).at_most(1);
    s.real("consistency", consistency, "Pa.s^m", "K")
        .above(0)
        .starter("179.2 MPa.s^m")
        .exponent_is("rate_sensitivity", rate_sensitivity);
    s.real("density", density, "kg/m^3", "mass per volume").above(0);
    s.string("against", against, "another body").names_section("body");
  }
  void validate(Section& s) const {
    if (law != Law::rigid) s.require("consistency", "law is not rigid");
  }
};

struct Time {
  std::optional<Real> end;
  Real step = 1;
  int increments = 10;
  Real tolerance = 0;
  void describe(Section& s) {
    s.real("end", end, "s", "when to stop").above(0);
    s.real("step", step, "s", "largest increment").above(0);
    s.integer("increments", increments, "how many").at_least(0);
    s.real("tolerance", tolerance, "", "relative").above(0).by_level(1e-3, 1e-4, 1e-6, 1e-8);
  }
};

struct Accuracy {
  Level level = Level::standard;
  void describe(Section& s) {
    s.choice("level", level,
             {{"draft", Level::draft},
              {"standard", Level::standard},
              {"fine", Level::fine},
              {"reference", Level::reference}},
             "preset");
  }
};

struct Gravity {
  std::array<Real, 3> acceleration = {0, 0, -9.81};
  void describe(Section& s) { s.vector("acceleration", acceleration, "m/s^2", "of free fall"); }
};

struct TestCase {
  Accuracy accuracy;
  Time time;
  std::optional<Gravity> gravity;
  std::vector<Body> bodies;
  void describe(CaseReader& reader) {
    reader.section("accuracy", accuracy, "presets");
    reader.section("time", time, "when");
    reader.optional("gravity", gravity, "weight");
    reader.repeated("body", bodies, "a body", 1);
  }
};

CaseReader make_reader(std::string_view text, const std::vector<std::string>& overrides = {}) {
  return {test::world(), CaseFile::parse(text, "test.ini", overrides)};
}

TestCase read(std::string_view text, const std::vector<std::string>& overrides = {}) {
  CaseReader reader = make_reader(text, overrides);
  TestCase result;
  result.describe(reader);
  reader.finish();
  return result;
}

std::string message_of(std::string_view text, const std::vector<std::string>& overrides = {}) {
  try {
    read(text, overrides);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

constexpr std::string_view good = R"(; a press
[accuracy]
level = fine
[body.billet]
group = "work piece"      ; quoted
consistency = 179.2 MPa.s^m
rate_sensitivity = 0.3
[body.die]
group = die
law = rigid
against = billet
[time]
end = 2 min
)";

TEST(CaseReader, ReadsValuesAndDefaults) {
  const TestCase result = read(good);
  ASSERT_EQ(result.bodies.size(), 2U);
  EXPECT_EQ(result.bodies[0].name, "billet");
  EXPECT_EQ(result.bodies[0].group, "work piece");
  EXPECT_EQ(result.bodies[0].consistency, 179.2e6);
  EXPECT_EQ(result.bodies[1].law, Law::rigid);
  EXPECT_EQ(result.time.end, 120.0);
  EXPECT_EQ(result.time.step, 1.0);
  EXPECT_EQ(result.time.tolerance, 1e-6);
  EXPECT_FALSE(result.gravity);
}

TEST(CaseReader, CommandLineWins) {
  const TestCase result = read(good, {"time.end=3 s", "gravity.acceleration=0 -1 m/s2", "body.die.law=newtonian",
                                      "body.die.consistency=1", "accuracy.level=draft"});
  EXPECT_EQ(result.time.end, 3.0);
  ASSERT_TRUE(result.gravity);
  EXPECT_EQ(result.gravity->acceleration[1], -1.0);
  EXPECT_EQ(result.bodies[1].consistency, 1.0);
  EXPECT_EQ(result.time.tolerance, 1e-3);
}

TEST(CaseReader, ReportsAllMistakesAtOnce) {
  const std::string message = message_of(R"([bdy.billet]
group = x
[body.die]
law = norton
consistensy = 3
consistency = 179.2 mm/s
rate_sensitivity = 3
step = 2
[time]
end = nan
end = 3
)");
  EXPECT_EQ(message,
            "9 mistakes in test.ini\n"
            "  test.ini:1: unknown section [bdy.billet]; did you mean 'body'?\n"
            "  test.ini:3: [body.die] needs 'group': physical volume (text)\n"
            "  test.ini:4: [body.die] law = norton: expected one of norton-hoff | newtonian | rigid; did you mean "
            "'norton-hoff'?\n"
            "  test.ini:5: unknown key 'consistensy' in [body.die]; did you mean 'consistency'?\n"
            "  test.ini:6: [body.die] consistency = 179.2 mm/s: unit 'mm/s' (velocity) does not fit, expected a unit "
            "like 'Pa.s^m'\n"
            "  test.ini:7: [body.die] rate_sensitivity = 3: 3 is outside (0, 1]\n"
            "  test.ini:8: unknown key 'step' in [body.die]; that key belongs to [time]\n"
            "  test.ini:10: [time] end = nan: 'nan' is not a finite number\n"
            "  test.ini:11: [time] end is given twice, first at test.ini:10");
}

}  // namespace
}  // namespace malleus
