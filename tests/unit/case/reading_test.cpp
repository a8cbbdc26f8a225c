/// A case read whole: values, defaults, and every kind of mistake.

#include <gtest/gtest.h>

#include <fstream>

#include "sample_case.hpp"
#include "support/scratch_directory.hpp"

namespace malleus::test {
namespace {

/// A case that is right but for the lines given, which stand from line 3 on.
std::string message_of_body(const std::string& lines) {
  return message_of("[body.a]\ngroup = a\n" + lines);
}

TEST(CaseReader, ReadsValuesAndDefaults) {
  const SampleCase result = read_sample(good_case);
  ASSERT_EQ(result.bodies.size(), 2U);
  EXPECT_EQ(result.bodies[0].name, "billet");
  EXPECT_EQ(result.bodies[0].group, "work piece");
  EXPECT_EQ(result.bodies[0].consistency, 179.2e6);
  EXPECT_EQ(result.bodies[1].law, Law::rigid);
  EXPECT_EQ(result.time.end, 120.0);
  EXPECT_EQ(result.time.step, 1.0);
  EXPECT_EQ(result.time.tolerance, 1e-6);
  EXPECT_FALSE(result.time.every);
  EXPECT_FALSE(result.gravity);
  EXPECT_EQ(result.files.title, "none ; yet");
}

TEST(CaseReader, CommandLineWins) {
  const SampleCase result =
      read_sample(good_case, {"time.end=3 s", "gravity.acceleration=0 -1 m/s2", "body.die.law=newtonian",
                              "body.die.consistency=1", "accuracy.level=draft", "time.every=auto"});
  EXPECT_EQ(result.time.end, 3.0);
  ASSERT_TRUE(result.gravity);
  EXPECT_EQ(result.gravity->acceleration[1], -1.0);
  EXPECT_EQ(result.bodies[1].consistency, 1.0);
  EXPECT_EQ(result.time.tolerance, 1e-3);
}

TEST(CaseReader, ExpressionsKnowWhereTheyWereWritten) {
  const SampleCase result = read_sample(good_case, {"gravity.force_x=x+1"});
  EXPECT_EQ(result.gravity->force[0]->source(), "command line: [gravity] force_x");
  EXPECT_EQ(result.gravity->strength.source(), "");
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

TEST(CaseReader, RefusesUnknownAndMisnamedSections) {
  EXPECT_EQ(message_of_body("law = rigid\n[tme]\n"), "test.ini:4: unknown section [tme]; did you mean 'time'?");
  EXPECT_EQ(message_of_body("law = rigid\n[xyzzy]\n"), "test.ini:4: unknown section [xyzzy]");
  EXPECT_EQ(message_of_body("law = rigid\n[body]\n"), "test.ini:4: section [body] needs a name: [body.NAME]");
  EXPECT_EQ(message_of_body("law = rigid\n[time.x]\n"), "test.ini:4: section [time.x] takes no name: [time]");
  EXPECT_EQ(message_of("[time]\n"), "test.ini: needs at least 1 section [body.NAME]: a body");
}

TEST(CaseReader, RefusesUnknownKeys) {
  EXPECT_EQ(message_of_body("law = rigid\nzzz = 1\n"),
            "test.ini:4: unknown key 'zzz' in [body.a]; known are group, law, rate_sensitivity, consistency, density, "
            "against, later, velocity");
  EXPECT_EQ(message_of_body("law = rigid\n"), "");
}

TEST(CaseReader, RefusesWrongValuesOfEveryType) {
  const std::vector<std::pair<std::string, std::string>> lines = {
      {"end = fast", "[time] end = fast: 'fast' is not a finite number"},
      {"end = 3 mm", "[time] end = 3 mm: unit 'mm' (length) does not fit, expected a unit like 's'"},
      {"end = 3 sek", "[time] end = 3 sek: unknown unit 'sek'; did you mean 's'?"},
      {"end = 0", "[time] end = 0: 0 is outside (0, inf) s"},
      {"step = 1 h", "[time] step = 1 h: 3600 is outside (0, 1000] s"},
      {"increments = 2.5", "[time] increments = 2.5: '2.5' is not a whole number"},
      {"increments = -1", "[time] increments = -1: -1 is outside [0, inf)"},
      {"nodes = 1e30", "[time] nodes = 1e30: '1e30' is not a whole number of this range"},
      {"every = often", "[time] every = often: 'often' is not a finite number, nor 'auto'"},
      {"follow = maybe", "[time] follow = maybe: expected yes or no"},
      {"wall_time = 1:00",
       "[time] wall_time = 1:00: expected hours:minutes:seconds as in 23:45:00, or a number with a "
       "unit as in 2 h"},
      {"wall_time = -3 s", "[time] wall_time = -3 s: -3 is outside [0, inf) s"}};
  for (const auto& [line, expected] : lines) {
    EXPECT_EQ(message_of_body("law = rigid\n[time]\n" + line), "test.ini:5: " + expected);
  }
  const std::vector<std::pair<std::string, std::string>> gravity_lines = {
      {"acceleration = 1", "[gravity] acceleration = 1: 1 number(s), expected two or three"},
      {"force_x = \"2*sx\"",
       "[gravity] force_x = \"2*sx\": expression '2*sx' is not understood at letter 3: unknown "
       "'sx'; did you mean 'x'?"},
      {"strength = -1 Pa", "[gravity] strength = -1 Pa: -1 is outside (0, inf) Pa"}};
  for (const auto& [line, expected] : gravity_lines) {
    EXPECT_EQ(message_of_body("law = rigid\n[gravity]\n" + line), "test.ini:5: " + expected);
  }
}

TEST(CaseReader, AChoiceMayBeLeftOpen) {
  const auto later = [](const std::string& line) {
    return read_sample("[body.a]\ngroup = a\nlaw = rigid\n" + line).bodies[0].later;
  };
  EXPECT_FALSE(later(""));
  EXPECT_FALSE(later("later = same"));
  EXPECT_EQ(later("later = rigid"), Law::rigid);
  EXPECT_EQ(message_of_body("law = rigid\nlater = soft"),
            "test.ini:4: [body.a] later = soft: expected one of newtonian | rigid, nor 'same'");
}

TEST(CaseReader, ChecksTheExponentOfAUnit) {
  EXPECT_EQ(message_of_body("consistency = 2 MPa.s^0.3\nrate_sensitivity = 0.3"), "");
  EXPECT_EQ(message_of_body("consistency = 2 MPa.s"), "");
  EXPECT_EQ(
      message_of_body("consistency = 2 MPa.s^0.3\nrate_sensitivity = 0.5"),
      "test.ini:3: [body.a] consistency = 2 MPa.s^0.3: the unit's power says m = 0.3, but rate_sensitivity = 0.5");
}

TEST(CaseReader, AsksTheStructsOwnRules) {
  EXPECT_EQ(message_of_body(""), "test.ini:1: [body.a] needs 'consistency' (law is not rigid)");
  EXPECT_EQ(message_of_body("law = rigid\ndensity = 1"),
            "test.ini:4: [body.a] density = 1: not allowed here (law = rigid)");
}

TEST(CaseReader, ChecksNamesOfSections) {
  EXPECT_EQ(message_of_body("law = rigid\nagainst = a"), "");
  EXPECT_EQ(message_of_body("law = rigid\nagainst = billet"),
            "test.ini:4: [body.a] against = billet: no section [body.billet]; the case has a");
  EXPECT_EQ(message_of("[body.billet]\ngroup = a\nlaw = rigid\nagainst = bilet"),
            "test.ini:4: [body.billet] against = bilet: no section [body.bilet]; did you mean 'billet'?");
}

TEST(CaseReader, ChecksPathsOnTheRoot) {
  EXPECT_EQ(message_of_body("law = rigid\n[files]\nmesh = absent.msh"),
            "test.ini:5: [files] mesh: no such file or directory: absent.msh");
  const ScratchDirectory scratch;
  const std::string directory = scratch.path().string();
  EXPECT_EQ(message_of_body("law = rigid\n[files]\nmesh = " + directory),
            "test.ini:5: [files] mesh: " + directory + " is a directory");
  EXPECT_EQ(message_of_body("law = rigid\n[files]\nfrom = " + directory), "");
  SampleCase sample;
  if (world().is_root()) std::ofstream(scratch.path() / "part.msh") << "mesh";
  world().barrier();
  read_sample(sample, "[body.a]\ngroup = a\nlaw = rigid\n[files]\nmesh = part.msh\n", {}, scratch.path() / "case.ini");
  EXPECT_EQ(sample.files.mesh, scratch.path() / "part.msh");
}

TEST(CaseReader, ChecksGroupsAndDimensionsAgainstTheMesh) {
  SampleCase sample;
  const std::string text =
      "[body.a]\ngroup = bilet\nlaw = rigid\nvelocity = 0 0 free\n"
      "[body.b]\ngroup = top\nlaw = rigid\n"
      "[body.c]\ngroup = xyzzy\nlaw = rigid\nvelocity = 0 free\n"
      "[gravity]\nacceleration = 0 0 1\nforce_z = 3\n";
  CaseReader reader = read_sample(sample, text);
  try {
    reader.check_mesh({2, {"billet", "die"}, {"top"}});
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "6 mistakes in test.ini\n"
                 "  test.ini:2: [body.a] group = bilet: the mesh has no volume group of that name; did you mean "
                 "'billet'?\n"
                 "  test.ini:4: [body.a] velocity: 3 components, but the mesh has 2 dimensions\n"
                 "  test.ini:6: [body.b] group = top: the mesh has no volume group of that name; it is a group of the "
                 "boundary\n"
                 "  test.ini:9: [body.c] group = xyzzy: the mesh has no volume group of that name; it has billet, die\n"
                 "  test.ini:13: [gravity] acceleration: 3 components, but the mesh has 2 dimensions\n"
                 "  test.ini:14: [gravity] force_z: a third component, but the mesh has 2 dimensions");
  }
  SampleCase good;
  CaseReader fine = read_sample(good, "[body.a]\ngroup = billet\nlaw = rigid\nvelocity = 0 0 free\n");
  EXPECT_NO_THROW(fine.check_mesh({3, {"billet"}, {}}));
}

TEST(CaseReader, TakesMistakesBetweenSections) {
  CaseReader reader(world(), CaseFile::parse(good_case, "test.ini"));
  SampleCase sample;
  sample.describe(reader);
  reader.fail("body.die", "law", "one rigid body too many");
  reader.fail("body.die", "density", "is missing");
  reader.fail("gravity", "", "is missing");
  try {
    reader.finish();
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "3 mistakes in test.ini\n"
                 "  test.ini:8: [body.die] density: is missing\n"
                 "  test.ini:10: [body.die] law = rigid: one rigid body too many\n"
                 "  test.ini: [gravity] is missing");
  }
  EXPECT_TRUE(reader.given("body.die", "law"));
  EXPECT_FALSE(reader.given("body.die", "density"));
  EXPECT_FALSE(reader.given("gravity", "force_x"));
}

TEST(CaseReader, AllRanksSayTheSame) {
  std::string mine = message_of("[time]\nend = 3 mm\n[files]\nmesh = absent.msh\n");
  std::string roots = mine;
  world().broadcast(roots);
  EXPECT_EQ(mine, roots);
  EXPECT_NE(mine.find("3 mistakes"), std::string::npos);
}

TEST(CaseReader, ADescriptionThatBindsAKeyTwiceIsADefect) {
  Real value = 0;
  Section section("x", nullptr, "", Level::standard);
  section.real("a", value, "m", "once");
  EXPECT_THROW(section.real("a", value, "m", "twice"), Defect);
  EXPECT_THROW(section.real("b", value, "mm", "not coherent"), Defect);
}

struct SelfRefusing {
  Real value = 0;
  void describe(Section& s) { s.real("value", value, "", "x").above(0); }
};

struct WrongStarter {
  Real value = 1;
  void describe(Section& s) { s.real("value", value, "m", "x").required().starter("3 kg"); }
};

TEST(CaseReader, ADescriptionThatRefusesItsOwnValuesIsADefect) {
  CaseReader reader;
  SelfRefusing self_refusing;
  EXPECT_THROW(reader.section("x", self_refusing, "x"), Defect);
  WrongStarter wrong_starter;
  EXPECT_THROW(reader.section("y", wrong_starter, "x"), Defect);
}

}  // namespace
}  // namespace malleus::test
