#include "storage/checkpoint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

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

  explicit Scene(const Communicator& comm, int dim) {
    test::BoxMeshOptions box;
    box.dim = dim;
    box.cells = {5, 3, 4};
    box.jitter = 0.2;
    mesh = test::box_mesh(comm, box);
    auto velocity = fields.declare(mesh, {"velocity", "m/s", Support::node, dim}).values();
    std::copy(mesh.coordinates.begin(), mesh.coordinates.end(), velocity.begin());
    Field& mark = fields.declare(mesh, {"mark", "1", Support::element, 1});
    for (LocalId e = 0; e < mesh.elements(); ++e) *mark.at(e) = static_cast<Real>(mesh.element_ids[e]);
    *fields.declare(mesh, {"clock", "s", Support::domain, 1}).at(0) = 0.1;
  }
};

void expect_same_scene(const SavedState& saved, const Scene& scene) {
  EXPECT_EQ(saved.mesh.total_nodes(), scene.mesh.total_nodes());
  EXPECT_EQ(saved.mesh.total_elements, scene.mesh.total_elements);
  ASSERT_EQ(saved.fields.size(), 3U);
  EXPECT_EQ(saved.fields[0].second, saved.mesh.coordinates);
  for (LocalId e = 0; e < saved.mesh.elements(); ++e) {
    EXPECT_EQ(saved.fields[1].second[e], static_cast<Real>(saved.mesh.element_ids[e]));
  }
  EXPECT_EQ(saved.fields[2].second, std::vector<Real>{0.1});
}

class Checkpoint : public testing::TestWithParam<int> {};

TEST_P(Checkpoint, ComesBackAsItWas) {
  const ScratchDirectory scratch;
  const Scene scene(world(), GetParam());
  CheckpointStore store(world(), scratch.path());
  store.write(7, scene.mesh, scene.fields, {{"time", 1.0 / 3.0}});
  const auto saved = store.read_newest();
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->increment, 7);
  EXPECT_EQ(saved->state.at("time").get<Real>(), 1.0 / 3.0);
  EXPECT_EQ(saved->mesh.element_nodes, scene.mesh.element_nodes);
  EXPECT_EQ(saved->mesh.coordinates, scene.mesh.coordinates);
  EXPECT_EQ(saved->mesh.facet_nodes, scene.mesh.facet_nodes);
  EXPECT_EQ(saved->mesh.facet_group, scene.mesh.facet_group);
  expect_same_scene(*saved, scene);
}

TEST_P(Checkpoint, TheNewestTwoAreKept) {
  const ScratchDirectory scratch;
  const Scene scene(world(), GetParam());
  CheckpointStore store(world(), scratch.path());
  for (GlobalId increment = 1; increment <= 4; ++increment) store.write(increment, scene.mesh, scene.fields, {});
  EXPECT_EQ(store.read_newest()->increment, 4);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(scratch.path() / "checkpoints"))
    names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"000000003", "000000004"}));
}

TEST_P(Checkpoint, AFlippedBitIsFoundAndTheOlderOneServes) {
  const ScratchDirectory scratch;
  const Scene scene(world(), GetParam());
  CheckpointStore store(world(), scratch.path());
  store.write(1, scene.mesh, scene.fields, {});
  store.write(2, scene.mesh, scene.fields, {});
  if (world().is_root()) {
    std::fstream file(scratch.path() / "checkpoints/000000002/part-00000.h5",
                      std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(3000);
    const int byte = file.peek();
    file.put(static_cast<char>(byte ^ 4));
  }
  world().barrier();
  EXPECT_EQ(store.read_newest()->increment, 1);
}

TEST_P(Checkpoint, OnesThatWerePassedOverDoNotCountAmongTheTwo) {
  const ScratchDirectory scratch;
  const Scene scene(world(), GetParam());
  CheckpointStore store(world(), scratch.path());
  store.write(1, scene.mesh, scene.fields, {});
  store.write(9, scene.mesh, scene.fields, {});
  const fs::path directory = scratch.path() / "checkpoints";
  if (world().is_root()) {
    fs::resize_file(directory / "000000009/part-00000.h5", 100);
    fs::create_directories(directory / "unfinished-000000005");
  }
  world().barrier();
  EXPECT_EQ(store.read_newest()->increment, 1);
  store.write(3, scene.mesh, scene.fields, {});
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(directory)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"000000001", "000000003"}));
}

TEST_P(Checkpoint, AnUnfinishedOneIsNeverTakenForWhole) {
  const ScratchDirectory scratch;
  const Scene scene(world(), GetParam());
  CheckpointStore store(world(), scratch.path());
  store.write(1, scene.mesh, scene.fields, {});
  if (world().is_root())
    fs::rename(scratch.path() / "checkpoints/000000001", scratch.path() / "checkpoints/unfinished-000000001");
  world().barrier();
  EXPECT_FALSE(store.read_newest().has_value());
}

TEST_P(Checkpoint, IsReadOnAnotherNumberOfRanks) {
  const ScratchDirectory scratch;
  const Scene scene(world(), GetParam());
  CheckpointStore(world(), scratch.path()).write(3, scene.mesh, scene.fields, {});
  MPI_Comm raw = MPI_COMM_NULL;
  const int fewer = std::max(1, world().size() - 1);
  MPI_Comm_split(world().raw(), world().rank() < fewer ? 0 : 1, world().rank(), &raw);
  {
    const Communicator part(raw);
    if (world().rank() < fewer) {
      const auto saved = CheckpointStore(part, scratch.path()).read_newest();
      ASSERT_TRUE(saved.has_value());
      expect_same_scene(*saved, scene);
    }
  }
  MPI_Comm_free(&raw);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Checkpoint, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
