/// case.resolved.ini: where each value came from, and that reading it again gives the same run.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "sample_case.hpp"
#include "support/scratch_directory.hpp"

namespace malleus::test {
namespace {

bool holds_line(const std::string& text, const std::string& setting, const std::string& origin) {
  const std::size_t at = text.find("\n" + setting + " ");
  if (at == std::string::npos) return false;
  const std::string line = text.substr(at + 1, text.find('\n', at + 1) - at - 1);
  return line.ends_with("; " + origin);
}

/// All that the sample's structs hold, bit for bit.
std::string bits_of(const SampleCase& c) {
  std::string text;
  const auto add = [&](const auto& value) { text += fmt::format("{:a} ", static_cast<double>(value)); };
  add(static_cast<int>(c.accuracy.level));
  for (const auto& value :
       {c.time.end, std::optional(c.time.step), std::optional(c.time.tolerance), c.time.wall_time}) {
    add(value.value_or(-1));
  }
  add(c.time.increments);
  add(c.time.nodes);
  add(c.time.every.value_or(-1));
  add(c.time.follow);
  if (c.gravity) {
    for (const Real value : c.gravity->acceleration) add(value);
    for (const auto& force : c.gravity->force) add(force ? (*force)({0.3, 0.7, 0.1}, 0.2) : -1);
    add(c.gravity->strength({0.3, 0.7, 0.1}, 0.2));
  }
  for (const Body& body : c.bodies) {
    text += body.name + "|" + body.group + "|" + body.against + "|";
    for (const Real value : {body.consistency.value_or(-1), body.rate_sensitivity, body.density.value_or(-1)})
      add(value);
    add(static_cast<int>(body.law));
    for (std::size_t i = 0; body.velocity && i < 3; ++i) add((*body.velocity)[i].value_or(-99));
  }
  text += c.files.title;
  for (const std::string& field : c.files.fields) text += "|" + field;
  return text;
}

constexpr std::string_view odd_case = R"([body.billet]
group = "work ; piece"
consistency = 1792e-1 MPa.s^0.3      ; a comment
rate_sensitivity = 0.3
velocity = 0.1 free -0.7 mm/s
[accuracy]
level = draft
[time]
end = 0.7 min
wall_time = 23:45:00
nodes = 3e5
[gravity]
acceleration = 0 -0.3 um/s^2
force_x = "sin(pi*x)  + 1/3"
strength = 7 kPa
[body.die]
group = die
law = rigid
)";

TEST(Resolved, SaysWhereValuesCameFrom) {
  SampleCase sample;
  const CaseReader reader = read_sample(sample, odd_case, {"time.step=3 ms", "files.title=a ; b"});
  const std::string text = reader.resolved("out");
  EXPECT_TRUE(holds_line(text, "consistency = 1792e-1 MPa.s^0.3", "test.ini:3")) << text;
  EXPECT_TRUE(holds_line(text, "step = 3 ms", "command line")) << text;
  EXPECT_TRUE(holds_line(text, "title = \"a ; b\"", "command line")) << text;
  EXPECT_TRUE(holds_line(text, "increments = 10", "default")) << text;
  EXPECT_TRUE(holds_line(text, "tolerance = 0.001", "accuracy level draft")) << text;
  EXPECT_TRUE(holds_line(text, "every = auto", "default")) << text;
  EXPECT_EQ(text.find("\nfrom ="), std::string::npos) << "a path that nobody gave is not in force";
  EXPECT_EQ(text.find("\nmesh ="), std::string::npos);
}

TEST(Resolved, ReadsBackToTheSameRun) {
  SampleCase first;
  const CaseReader reader = read_sample(first, odd_case, {"time.step=0.1 ms", "files.title=a ; b", "time.every=auto"});
  const std::string text = reader.resolved("out");
  SampleCase second;
  const CaseReader again = read_sample(second, text);
  EXPECT_EQ(bits_of(first), bits_of(second)) << text;
  SampleCase third;
  read_sample(third, again.resolved("out"));
  EXPECT_EQ(bits_of(first), bits_of(third));
}

TEST(Resolved, KeepsSectionsThatTheCommandLineMade) {
  SampleCase first;
  const CaseReader reader = read_sample(first, good_case, {"gravity.acceleration=0 0 0.1"});
  SampleCase second;
  read_sample(second, reader.resolved("out"));
  ASSERT_TRUE(second.gravity);
  EXPECT_EQ(bits_of(first), bits_of(second));
}

TEST(Resolved, KeepsALevelsValuesWhenTheLevelChanges) {
  SampleCase first;
  const CaseReader reader = read_sample(first, good_case);
  SampleCase second;
  read_sample(second, reader.resolved("out"), {"accuracy.level=draft"});
  EXPECT_EQ(first.time.tolerance, second.time.tolerance) << "every key is given by itself in a resolved case";
}

TEST(Resolved, DefaultVectorsHaveTheMeshsDimension) {
  const std::string text = std::string(good_case) + "[gravity]\n";
  SampleCase sample;
  CaseReader reader = read_sample(sample, text);
  reader.check_mesh({2, {"work piece", "die"}, {}});
  EXPECT_TRUE(holds_line(reader.resolved("out"), "acceleration = 0 -9.81 m/s^2", "default")) << reader.resolved("out");
  SampleCase again;
  CaseReader second = read_sample(again, reader.resolved("out"));
  EXPECT_NO_THROW(second.check_mesh({2, {"work piece", "die"}, {}}));
  EXPECT_EQ(bits_of(sample), bits_of(again));
}

struct Inlet {
  std::string name;
  bool by_pressure = false;
  Real velocity = 1;
  Real angle = 0.5;
  void describe(Section& s) {
    s.flag("by_pressure", by_pressure, "kind");
    s.real("velocity", velocity, "m/s", "inflow").above(0);
    s.real("angle", angle, "rad", "inflow").above(0);
  }
  void validate(Section& s) const {
    if (by_pressure) s.refuse("velocity", "by_pressure");
    s.refuse_more_than_one_of({"angle", "by_pressure"});
  }
};

TEST(Resolved, LeavesOutDefaultsThatAreNotInForce) {
  const auto resolved_of = [](std::string_view text) {
    CaseReader reader(world(), CaseFile::parse(text, "test.ini"));
    std::vector<Inlet> inlets;
    reader.repeated("inlet", inlets, "x");
    reader.finish();
    return reader.resolved("out");
  };
  const std::string text = resolved_of("[inlet.a]\nby_pressure = yes\n");
  EXPECT_EQ(text.find("velocity"), std::string::npos);
  EXPECT_EQ(text.find("angle"), std::string::npos);
  EXPECT_NO_THROW(resolved_of(text));
  EXPECT_TRUE(holds_line(resolved_of("[inlet.a]\n"), "velocity = 1 m/s", "default"));
}

TEST(Resolved, RecordsWhatTheProgramChose) {
  SampleCase sample;
  CaseReader reader = read_sample(sample, good_case);
  reader.record("time", "every", "7", "chosen");
  EXPECT_TRUE(holds_line(reader.resolved("out"), "every = 7", "chosen"));
  EXPECT_THROW(reader.record("time", "nothing", "7", "chosen"), Defect);
}

/// The mesh that a resolved case names, seen from where that case is written.
std::filesystem::path mesh_after_moving(const std::filesystem::path& case_file, const std::string& mesh,
                                        const std::filesystem::path& output) {
  const std::string text = std::string(good_case) + "[files]\nmesh = " + mesh + "\n";
  SampleCase first;
  const CaseReader reader = read_sample(first, text, {}, case_file);
  SampleCase second;
  read_sample(second, reader.resolved(output), {}, output / "case.resolved.ini");
  EXPECT_EQ(std::filesystem::weakly_canonical(first.files.mesh), std::filesystem::weakly_canonical(second.files.mesh));
  return second.files.mesh;
}

TEST(Resolved, PathsStayValid) {
  const ScratchDirectory scratch;
  const std::filesystem::path top = scratch.path();
  if (world().is_root()) {
    std::filesystem::create_directories(top / "project/out/press");
    std::filesystem::create_directories(top / "elsewhere");
    std::filesystem::create_directories(top / "meshes");
    std::ofstream(top / "project/my ; part.msh") << "mesh";
    std::ofstream(top / "meshes/part.msh") << "mesh";
  }
  world().barrier();
  const auto case_file = top / "project/case.ini";
  mesh_after_moving(case_file, "\"my ; part.msh\"", top / "project/out/press");
  mesh_after_moving(case_file, "\"my ; part.msh\"", top / "project");
  mesh_after_moving(case_file, "\"my ; part.msh\"", top / "elsewhere");
  mesh_after_moving(case_file, "../meshes/part.msh", top / "project/out/press");
  mesh_after_moving(case_file, (top / "meshes/part.msh").string(), top / "elsewhere");

  SampleCase sample;
  const std::string text = std::string(good_case) + "[files]\nmesh = ../meshes/part.msh\n";
  const CaseReader reader = read_sample(sample, text, {}, case_file);
  EXPECT_TRUE(holds_line(reader.resolved(top / "project/out/press"), "mesh = ../../../meshes/part.msh",
                         case_file.string() + ":15"))
      << "below the case paths stay relative, so that the project may be moved\n"
      << reader.resolved(top / "project/out/press");
}

}  // namespace
}  // namespace malleus::test
