#include "mesh/msh_writer.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "mesh/distribute.hpp"
#include "mesh/msh_reader.hpp"
#include "mesh/verify.hpp"
#include "support/mesh_checksum.hpp"
#include "support/msh_files.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

class WrittenMsh : public testing::TestWithParam<std::tuple<int, std::size_t>> {};

TEST_P(WrittenMsh, IsReadBackBitForBit) {
  const auto [dim, flavour] = GetParam();
  const test::ScratchDirectory scratch;
  const std::string input = put_file(scratch, "in.msh", msh_bytes(test::box_msh(dim, 3), {4, true}));
  // Coordinates without a short decimal form.
  const Mesh mesh = build_mesh(world(), read_msh(world(), input, 1.0 / 3.0));
  const std::string output = (scratch.path() / "out.msh").string();
  write_msh(world(), mesh, output, {test::msh_flavours[flavour].version, test::msh_flavours[flavour].binary});
  const Mesh again = build_mesh(world(), read_msh(world(), output));
  EXPECT_EQ(again.region_names, mesh.region_names);
  EXPECT_EQ(again.group_names, mesh.group_names);
  EXPECT_EQ(again.total_nodes(), mesh.total_nodes());
  EXPECT_EQ(again.total_elements, mesh.total_elements);
  EXPECT_EQ(test::checksum_of_nodes(again), test::checksum_of_nodes(mesh));
  EXPECT_EQ(test::checksum_of_elements(again), test::checksum_of_elements(mesh));
  EXPECT_EQ(test::checksum_of_groups(again), test::checksum_of_groups(mesh));
  EXPECT_EQ(broken_promises(world(), again), std::vector<std::string>{});
  EXPECT_FALSE(std::filesystem::exists(output + ".tmp"));
}

INSTANTIATE_TEST_SUITE_P(Flavours, WrittenMsh,
                         testing::Combine(testing::Values(2, 3), testing::Values(0U, 1U, 2U, 3U)));

TEST(MshWriter, AnUnwritablePlaceIsAStorageErrorOnAllRanks) {
  const test::ScratchDirectory scratch;
  const std::string input = put_file(scratch, "in.msh", msh_bytes(test::box_msh(2, 1), {2, false}));
  const Mesh mesh = build_mesh(world(), read_msh(world(), input));
  try {
    write_msh(world(), mesh, (scratch.path() / "no" / "out.msh").string());
    FAIL() << "no error was raised";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::storage);
    EXPECT_NE(std::string(error.what()).find("out.msh: cannot be created"), std::string::npos);
  }
}

}  // namespace
}  // namespace malleus
