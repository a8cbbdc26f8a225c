#include "storage/mesh_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "base/error.hpp"
#include "mesh/simplex.hpp"
#include "support/box_mesh.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::ScratchDirectory;
using test::world;

class MeshFile : public testing::TestWithParam<int> {
 protected:
  MeshFile() {
    test::BoxMeshOptions box;
    box.dim = GetParam();
    box.cells = {4, 3, 5};
    mesh = test::box_mesh(world(), box);
    auto place = fields.declare(mesh, {"place", "m", Support::node, mesh.dim}).values();
    std::copy(mesh.coordinates.begin(), mesh.coordinates.end(), place.begin());
    Field& id = fields.declare(mesh, {"id", "1", Support::element, 1});
    for (LocalId e = 0; e < mesh.elements(); ++e) *id.at(e) = static_cast<Real>(mesh.element_ids[e]);
    path = scratch.path() / "mesh.h5";
  }

  ScratchDirectory scratch;
  std::filesystem::path path;
  Mesh mesh;
  FieldStore fields;
};

TEST_P(MeshFile, IsReadBackOnTheSameRanks) {
  write_mesh_file(world(), path, mesh, fields);
  FieldStore read_fields;
  const Mesh read = read_mesh_file(world(), path, 1, read_fields);
  EXPECT_EQ(read.element_nodes, mesh.element_nodes);
  EXPECT_EQ(read.coordinates, mesh.coordinates);
  EXPECT_EQ(read.facet_group, mesh.facet_group);
  EXPECT_EQ(read.group_names, mesh.group_names);
  EXPECT_EQ(read.element_ids, mesh.element_ids);
  const auto place = read_fields["place"].values();
  EXPECT_TRUE(std::equal(place.begin(), place.end(), read.coordinates.begin(), read.coordinates.end()));
  for (LocalId e = 0; e < read.elements(); ++e)
    EXPECT_EQ(*read_fields["id"].at(e), static_cast<Real>(read.element_ids[e]));
}

TEST_P(MeshFile, LengthsAreScaledByTheUnit) {
  write_mesh_file(world(), path, mesh, fields);
  FieldStore read_fields;
  const Mesh read = read_mesh_file(world(), path, 1e-3, read_fields);
  Real highest = 0;
  for (const Real x : read.coordinates) highest = std::max(highest, x);
  EXPECT_NEAR(world().max(highest), 1e-3, 1e-18);
}

TEST_P(MeshFile, ADamagedOrForeignFileIsAnInputError) {
  write_mesh_file(world(), path, mesh, fields);
  if (world().is_root()) {
    const auto size = std::filesystem::file_size(path);
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    std::string bytes(size, ' ');
    file.read(bytes.data(), static_cast<std::streamsize>(size));
    const Real half = GetParam() == 3 ? 2.0 / 3.0 : 1.0 / 3.0;
    const auto at = bytes.find(std::string(reinterpret_cast<const char*>(&half), sizeof(half)));
    ASSERT_NE(at, std::string::npos);
    file.seekp(static_cast<std::streamoff>(at));
    file.put(static_cast<char>(bytes[at] ^ 1));
  }
  world().barrier();
  const auto code_of = [&](const std::filesystem::path& file) {
    FieldStore read_fields;
    try {
      read_mesh_file(world(), file, 1, read_fields);
    } catch (const Error& error) {
      return error.code();
    }
    return 0;
  };
  EXPECT_EQ(code_of(path), exit_code::wrong_input);
  if (world().is_root()) std::ofstream(scratch.path() / "text.h5") << "nothing";
  world().barrier();
  EXPECT_EQ(code_of(scratch.path() / "text.h5"), exit_code::wrong_input);
  EXPECT_EQ(code_of(scratch.path() / "absent.h5"), exit_code::wrong_input);
}

TEST_P(MeshFile, AFlippedBitAnywhereIsFound) {
  write_mesh_file(world(), path, mesh, fields);
  const auto size = static_cast<std::size_t>(std::filesystem::file_size(path));
  const auto flip = [&](std::size_t at) {
    if (world().is_root()) {
      std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
      file.seekg(static_cast<std::streamoff>(at));
      const int byte = file.get();
      file.seekp(static_cast<std::streamoff>(at));
      file.put(static_cast<char>(byte ^ (1 << at % 8)));
    }
    world().barrier();
  };
  for (std::size_t at = 0; at < size; at += 1 + size / 97) {
    flip(at);
    FieldStore read_fields;
    EXPECT_THROW(read_mesh_file(world(), path, 1, read_fields), InputError) << at;
    flip(at);
  }
  if (world().is_root()) std::filesystem::resize_file(path, size - 1);
  world().barrier();
  FieldStore read_fields;
  EXPECT_THROW(read_mesh_file(world(), path, 1, read_fields), InputError);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, MeshFile, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
