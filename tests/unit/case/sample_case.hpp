#pragma once

/// A small case that uses every type of key, for the tests of the case reader.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "case/schema.hpp"
#include "support/world.hpp"

namespace malleus::test {

enum class Law { norton_hoff, newtonian, rigid };

struct Body {
  std::string name;
  std::string group;
  Law law = Law::norton_hoff;
  std::optional<Real> consistency;
  Real rate_sensitivity = 1;
  std::optional<Real> density;
  std::string against;
  std::optional<Law> later;
  std::optional<std::array<std::optional<Real>, 3>> velocity;

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
    s.choice("later", later, {{"newtonian", Law::newtonian}, {"rigid", Law::rigid}}, "law after the stroke")
        .or_word("same");
    s.partial_vector("velocity", velocity, "m/s", "imposed").starter("0 0 free mm/s");
  }
  void validate(Section& s) const {
    if (law != Law::rigid) s.require("consistency", "law is not rigid");
    if (law == Law::rigid) s.refuse("density", "law = rigid");
  }
};

struct Time {
  std::optional<Real> end;
  Real step = 1;
  int increments = 10;
  GlobalId nodes = 1000;
  Real tolerance = 0;
  std::optional<int> every;
  bool follow = true;
  std::optional<Real> wall_time;

  void describe(Section& s) {
    s.real("end", end, "s", "when to stop").above(0);
    s.real("step", step, "s", "largest increment").above(0).at_most(1000);
    s.integer("increments", increments, "how many").at_least(0);
    s.count("nodes", nodes, "how large").at_least(0);
    s.real("tolerance", tolerance, "", "relative").above(0).by_level(1e-3, 1e-4, 1e-6, 1e-8);
    s.integer("every", every, "interval").at_least(1).or_word("auto");
    s.flag("follow", follow, "whether to");
    s.duration("wall_time", wall_time, "limit");
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
  std::array<Real, 3> acceleration = {0, -9.81, 0};
  std::array<std::optional<Expression>, 3> force;
  Expression strength = Expression(1);

  void describe(Section& s) {
    s.vector("acceleration", acceleration, "m/s^2", "of free fall");
    s.expressions("force", force, "N", "its components");
    s.expression("strength", strength, "Pa", "factor").above(0).starter("\"1 + x\"");
  }
};

struct Files {
  std::filesystem::path mesh;
  std::filesystem::path from;
  std::string title = "none ; yet";
  std::vector<std::string> fields = {"velocity", "two words"};

  void describe(Section& s) {
    s.path("mesh", mesh, "the mesh").existing_file().starter("part.msh");
    s.path("from", from, "another run").existing_directory();
    s.string("title", title, "for people");
    s.words("fields", fields, "written");
  }
};

struct SampleCase {
  Accuracy accuracy;
  Time time;
  std::optional<Gravity> gravity;
  Files files;
  std::vector<Body> bodies;

  void describe(CaseReader& reader) {
    reader.section("accuracy", accuracy, "presets");
    reader.section("time", time, "when");
    reader.optional("gravity", gravity, "weight");
    reader.section("files", files, "what is read");
    reader.repeated("body", bodies, "a body", 1);
  }
};

using Overrides = std::vector<std::string>;

/// Reads the text on all ranks; the reader is returned for what comes after finish().
inline CaseReader read_sample(SampleCase& sample, std::string_view text, const Overrides& overrides = {},
                              const std::filesystem::path& path = "test.ini") {
  CaseReader reader(world(), CaseFile::parse(text, path, overrides));
  sample.describe(reader);
  reader.finish();
  return reader;
}

inline SampleCase read_sample(std::string_view text, const Overrides& overrides = {}) {
  SampleCase sample;
  read_sample(sample, text, overrides);
  return sample;
}

/// What the user would be told, or empty.
inline std::string message_of(std::string_view text, const Overrides& overrides = {}) {
  try {
    read_sample(text, overrides);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

inline constexpr std::string_view good_case = R"(; a press
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

}  // namespace malleus::test
