#include "mesh/medit_mesh.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "mesh/msh_reader.hpp"
#include "mesh/verify.hpp"
#include "support/mesh_checksum.hpp"
#include "support/msh_files.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

class MeditMeshFile : public testing::TestWithParam<std::tuple<int, const char*>> {
 protected:
  int dim() const { return std::get<0>(GetParam()); }
  std::string ending() const { return std::get<1>(GetParam()); }
  Mesh input(const test::ScratchDirectory& scratch) const {
    const std::string path = put_file(scratch, "in.msh", msh_bytes(test::box_msh(dim(), 3), {4, true}));
    return build_mesh(world(), read_msh(world(), path, 1.0 / 3.0));
  }
};

TEST_P(MeditMeshFile, IsReadBackBitForBitWithItsNames) {
  const test::ScratchDirectory scratch;
  const Mesh mesh = input(scratch);
  const std::string path = (scratch.path() / "out").string() + ending();
  write_medit_mesh(world(), mesh, path);
  const Mesh again = build_mesh(world(), read_medit_mesh(world(), path));
  EXPECT_EQ(again.dim, mesh.dim);
  EXPECT_EQ(again.region_names, mesh.region_names);
  EXPECT_EQ(again.group_names, mesh.group_names);
  EXPECT_EQ(test::checksum_of_nodes(again), test::checksum_of_nodes(mesh));
  EXPECT_EQ(test::checksum_of_elements(again), test::checksum_of_elements(mesh));
  EXPECT_EQ(test::checksum_of_groups(again), test::checksum_of_groups(mesh));
  EXPECT_EQ(broken_promises(world(), again), std::vector<std::string>{});
}

TEST_P(MeditMeshFile, WithoutNamesNumbersAreTheNames) {
  const test::ScratchDirectory scratch;
  const std::string path = (scratch.path() / "out").string() + ending();
  write_medit_mesh(world(), input(scratch), path);
  world().barrier();
  if (world().is_root()) std::filesystem::remove(scratch.path() / "out.names");
  const MeshChunk chunk = read_medit_mesh(world(), path);
  EXPECT_EQ(chunk.region_names, (std::vector<std::string>{"1", "2"}));
  EXPECT_EQ(chunk.group_names, (std::vector<std::string>{"1", "2", "3"}));
}

INSTANTIATE_TEST_SUITE_P(Forms, MeditMeshFile,
                         testing::Combine(testing::Values(2, 3), testing::Values(".mesh", ".meshb")));

TEST(MeditMesh, ReferencesOfZeroAreNoGroups) {
  const test::ScratchDirectory scratch;
  const std::string path =
      put_file(scratch, "one.mesh",
               "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
               "Triangles\n2\n1 2 3 0\n1 2 4 5\nTetrahedra\n1\n1 2 3 4 0\nEnd\n");
  const Mesh mesh = build_mesh(world(), read_medit_mesh(world(), path, 2));
  EXPECT_EQ(mesh.region_names, std::vector<std::string>{"default"});
  EXPECT_EQ(mesh.group_names, std::vector<std::string>{"5"});
  GlobalId named = 0;
  for (const std::int32_t group : mesh.facet_group) named += group >= 0 ? 1 : 0;
  EXPECT_EQ(world().sum(named), 1);
}

TEST(MeditMesh, TetrahedraInAPlaneAreAnInputError) {
  const test::ScratchDirectory scratch;
  const std::string path = put_file(scratch, "flat.mesh",
                                    "MeshVersionFormatted 2\nDimension 2\nVertices\n4\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
                                    "Tetrahedra\n1\n1 2 3 4 0\nEnd\n");
  EXPECT_THROW(read_medit_mesh(world(), path), InputError);
}

TEST(MeditMesh, AMissingFileIsAnInputErrorOnAllRanks) {
  try {
    read_medit_mesh(world(), "/nonexistent/a.mesh");
    FAIL() << "no error was raised";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::wrong_input);
  }
}

}  // namespace
}  // namespace malleus
