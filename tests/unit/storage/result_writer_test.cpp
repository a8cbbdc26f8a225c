#include "storage/result_writer.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "base/error.hpp"
#include "storage/atomic_file.hpp"
#include "storage/h5_file.hpp"
#include "support/box_mesh.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::ScratchDirectory;
using test::world;
namespace fs = std::filesystem;

struct Scene {
  Mesh mesh;
  FieldStore fields;
  explicit Scene(int dim) {
    test::BoxMeshOptions box;
    box.dim = dim;
    box.cells = {3, 2, 2};
    mesh = test::box_mesh(world(), box);
    auto velocity = fields.declare(mesh, {"velocity", "m/s", Support::node, dim}).values();
    std::copy(mesh.coordinates.begin(), mesh.coordinates.end(), velocity.begin());
    fields.declare(mesh, {"stress", "Pa", Support::element, dim * (dim + 1) / 2});
  }
  std::vector<const Field*> all() const { return std::as_const(fields).all(); }
};

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

class Results : public testing::TestWithParam<int> {};

TEST_P(Results, EachRanksPartCanBeReadBack) {
  const ScratchDirectory scratch;
  const Scene scene(GetParam());
  ResultWriter writer(world(), scratch.path(), "run", ResultWriter::Precision::float64);
  writer.start_anew();
  writer.write(3, 0.5, scene.mesh, scene.all());
  world().barrier();
  if (scene.mesh.elements() == 0) return;
  H5File file(scratch.path() / "run.fields" / ("s000003.r000" + std::to_string(world().rank()) + ".h5"),
              H5File::Mode::read);
  const std::string group = "/p000" + std::to_string(world().rank());
  EXPECT_EQ(file.read_int32(group + "/cells"), scene.mesh.element_nodes);
  const auto velocity = file.read_doubles(group + "/velocity");
  const auto points = file.read_doubles(group + "/points");
  EXPECT_EQ(velocity, points);
  EXPECT_EQ(file.dims(group + "/stress"),
            (std::vector<std::uint64_t>{static_cast<std::uint64_t>(scene.mesh.elements()), 6}));
}

TEST_P(Results, TheIndexNamesEveryStepAndPart) {
  const ScratchDirectory scratch;
  const Scene scene(GetParam());
  ResultWriter writer(world(), scratch.path(), "run", ResultWriter::Precision::float32);
  writer.start_anew();
  for (GlobalId step = 0; step < 3; ++step) writer.write(step, 0.1 * static_cast<Real>(step), scene.mesh, scene.all());
  const GlobalId parts = world().sum(static_cast<GlobalId>(scene.mesh.elements() > 0 ? 1 : 0));
  const std::string index = read_text_file(scratch.path() / "run.xdmf");
  EXPECT_EQ(count(index, "<Time "), 3U);
  EXPECT_EQ(count(index, "GridType=\"Uniform\""), static_cast<std::size_t>(3 * parts));
  EXPECT_EQ(count(index, scratch.path().string()), 0U) << "paths are relative";
}

TEST_P(Results, AResumedRunReplacesTheStepsAfterItsStart) {
  const ScratchDirectory scratch;
  const Scene scene(GetParam());
  {
    ResultWriter writer(world(), scratch.path(), "run", ResultWriter::Precision::float32);
    writer.start_anew();
    for (GlobalId step = 0; step < 4; ++step) writer.write(step, static_cast<Real>(step), scene.mesh, scene.all());
  }
  ResultWriter writer(world(), scratch.path(), "run", ResultWriter::Precision::float32);
  writer.resume_after(1);
  writer.write(2, 20.0, scene.mesh, scene.all());
  world().barrier();
  const std::string index = read_text_file(scratch.path() / "run.xdmf");
  EXPECT_EQ(count(index, "<Time "), 3U);
  EXPECT_EQ(count(index, "Value=\"20\""), 1U);
  EXPECT_EQ(count(index, "Value=\"3\""), 0U);
}

TEST_P(Results, ADirectoryThatCannotBeMadeIsAStorageErrorOnAllRanks) {
  const ScratchDirectory scratch;
  if (world().is_root()) std::ofstream(scratch.path() / "file") << "in the way";
  world().barrier();
  ResultWriter writer(world(), scratch.path() / "file" / "run", "run", ResultWriter::Precision::float32);
  try {
    writer.start_anew();
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::storage);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Results, testing::Values(2, 3));

TEST(H5File, ADamagedFileIsAStorageError) {
  const ScratchDirectory scratch;
  const fs::path path = scratch.path() / ("part" + std::to_string(world().rank()));
  std::ofstream(path) << "this is no HDF5 file";
  EXPECT_THROW(H5File(path, H5File::Mode::read), StorageError);
}

}  // namespace
}  // namespace malleus
