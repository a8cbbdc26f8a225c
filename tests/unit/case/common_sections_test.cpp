/// The sections that both programs share.

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "case/common_sections.hpp"
#include "case/help.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

struct WholeCase : CommonSections {
  TimeSettings time;
  InitialSettings initial;
  void describe(CaseReader& reader) {
    describe_start(reader);
    reader.section("time", time, "when the run ends");
    describe_scene(reader);
    reader.section("initial", initial, "the state at the start");
    describe_run(reader);
  }
};

WholeCase read(const std::string& text) {
  // What the mesh file holds is not read here: any file will do.
  CaseReader reader(test::world(), CaseFile::parse("[mesh]\nfile = /dev/null\n" + text, "test.ini"));
  WholeCase result;
  result.describe(reader);
  reader.finish();
  return result;
}

std::string message_of(const std::string& text) {
  try {
    read(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CommonSections, LevelsMoveTolerancesTogether) {
  EXPECT_EQ(read("").solver.newton_tolerance, 1e-4);
  const SolverSettings draft = read("[accuracy]\nlevel = draft").solver;
  EXPECT_EQ(draft.newton_tolerance, 1e-3);
  EXPECT_EQ(draft.cutoff_strain_rate, 3e-2);
  const SolverSettings fine = read("[accuracy]\nlevel = fine\n[solver]\nlinear_tolerance = 1e-9").solver;
  EXPECT_EQ(fine.newton_tolerance, 1e-6);
  EXPECT_EQ(fine.linear_tolerance, 1e-9);
  const SolverSettings reference = read("[accuracy]\nlevel = reference").solver;
  EXPECT_EQ(reference.newton_tolerance, 1e-8);
  EXPECT_EQ(reference.cutoff_strain_rate, 1e-4);
}

TEST(CommonSections, AbsentSectionsModelNothing) {
  const WholeCase result = read("");
  EXPECT_FALSE(result.thermal || result.gravity || result.inertia || result.remesh || result.air || result.reference);
  EXPECT_TRUE(read("[inertia]").inertia);
  EXPECT_TRUE(read("[remesh]").remesh->active);
}

TEST(CommonSections, CheckpointsCountIncrementsOrTime) {
  EXPECT_EQ(read("").checkpoint.every.seconds, 600.0);
  EXPECT_EQ(read("[checkpoint]\nevery = 20").checkpoint.every.increments, 20);
  EXPECT_FALSE(read("[checkpoint]\nevery = 20").checkpoint.every.seconds);
  EXPECT_EQ(read("[checkpoint]\nevery = 2 h").checkpoint.every.seconds, 7200.0);
  EXPECT_EQ(read("[checkpoint]\nevery = 00:30:00").checkpoint.every.seconds, 1800.0);
  EXPECT_NE(message_of("[checkpoint]\nevery = 0"), "");
  EXPECT_NE(message_of("[checkpoint]\nevery = 2 mm"), "");
}

TEST(CommonSections, BoundariesTakeVectorsOrExpressions) {
  const auto boundaries = read(R"([boundary.a]
group = a
velocity = 0 free -3 mm/s
[boundary.b]
group = b
velocity_x = "2*y"
traction_y = 5 kPa
[boundary.c]
group = c
type = symmetry
)")
                              .boundaries;
  ASSERT_EQ(boundaries.size(), 3U);
  const ExpressionVector a = boundaries[0].imposed_velocity();
  EXPECT_EQ((*a[2])({}, 0), -0.003);
  EXPECT_FALSE(a[1]);
  EXPECT_EQ((*boundaries[1].imposed_velocity()[0])({0, 4, 0}, 0), 8.0);
  EXPECT_EQ(boundaries[1].imposed_traction()[1]({}, 0), 5000.0);
  EXPECT_EQ(boundaries[1].imposed_traction()[2]({}, 0), 0.0);
  EXPECT_EQ(boundaries[2].type, BoundarySettings::Type::symmetry);
  EXPECT_FALSE(boundaries[2].has_velocity() || boundaries[2].has_traction());
}

TEST(CommonSections, RefusesContradictions) {
  EXPECT_NE(message_of("[boundary.a]\ngroup = a").find("needs velocity"), std::string::npos);
  EXPECT_NE(message_of("[boundary.a]\ngroup = a\ntype = symmetry\npressure = 1").find("symmetry allows no"),
            std::string::npos);
  EXPECT_NE(message_of("[boundary.a]\ngroup = a\nvelocity = 0 0\nvelocity_x = 1").find("already given as velocity"),
            std::string::npos);
  EXPECT_NE(message_of("[probe.a]").find("needs one of file, point"), std::string::npos);
  EXPECT_NE(message_of("[probe.a]\npoint = 0 0\nfile = /dev/null").find("only one of"), std::string::npos);
  EXPECT_NE(message_of("[remesh]\nmin_size = 2\nmax_size = 1").find("must not exceed max_size"), std::string::npos);
  EXPECT_NE(message_of("[case]\nname = a/b").find("name of a file"), std::string::npos);
  EXPECT_NE(message_of("[reference]\nat = every").find("needs velocity_x"), std::string::npos);
}

TEST(CommonSections, LengthUnitScalesTheMesh) {
  EXPECT_EQ(read("[case]\ntitle = x").mesh.length_scale(), 1.0);
  MeshSettings mesh;
  mesh.length_unit = "mm";
  EXPECT_EQ(mesh.length_scale(), 1e-3);
  CaseReader reader(test::world(), CaseFile::parse("[mesh]\nfile = /dev/null\nlength_unit = kg", "test.ini"));
  WholeCase wrong;
  wrong.describe(reader);
  EXPECT_THROW(reader.finish(), InputError);
}

}  // namespace
}  // namespace malleus
