/// Damaged and unsupported MSH files: one message that names the file and the place, on any rank count.

#include <gtest/gtest.h>

#include <random>

#include "base/error.hpp"
#include "mesh/msh_reader.hpp"
#include "support/msh_files.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_msh;
using test::msh_bytes;
using test::msh_flavours;
using test::MshMesh;
using test::put_file;
using test::ScratchDirectory;
using test::world;

/// What the user is told, with FILE for the path; "" where the mesh is read.
std::string told(const std::string& bytes) {
  const ScratchDirectory scratch;
  const std::string path = put_file(scratch, "damaged.msh", bytes);
  try {
    build_mesh(world(), read_msh(world(), path));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::wrong_input);
    std::string text = error.what();
    const std::size_t at = text.find(path);
    if (at != std::string::npos) text.replace(at, path.size(), "FILE");
    return text;
  }
  return "";
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

std::string ascii(int version, int dim = 3) {
  return msh_bytes(box_msh(dim, 2), {version, false});
}

TEST(DamagedMsh, CutAnywhereIsRefused) {
  for (const test::MshFlavour flavour : msh_flavours) {
    const std::string whole = msh_bytes(box_msh(3, 1), flavour);
    const std::size_t step = whole.size() / 24 + 1;
    for (std::size_t size = 0; size + 2 < whole.size(); size += step) {
      const std::string text = told(whole.substr(0, size));
      EXPECT_EQ(text.substr(0, 4), "FILE") << "cut after " << size << " of " << whole.size() << ": " << text;
    }
  }
}

TEST(DamagedMsh, ChangedBytesNeverCrash) {
  std::mt19937 random(11);
  int refused = 0;
  for (const test::MshFlavour flavour : msh_flavours) {
    const std::string whole = msh_bytes(box_msh(3, 1), flavour);
    for (int i = 0; i < 30; ++i) {
      std::string damaged = whole;
      damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
      damaged[random() % damaged.size()] = static_cast<char>("0-9eN$\n\xff"[random() % 8]);
      refused += told(damaged).empty() ? 0 : 1;
    }
  }
  EXPECT_GT(refused, 50);
}

TEST(DamagedMsh, ValuesAreNamedWithTheirLine) {
  EXPECT_EQ(told(""), "FILE:1: is not a gmsh mesh: it does not begin with $MeshFormat");
  EXPECT_EQ(told(replaced(ascii(2), "2.2 0 8", "4.0 0 8")),
            "FILE:2: MSH version 4 is not read; 2.2 and 4.1 are (gmsh: Mesh.MshFileVersion = 4.1)");
  EXPECT_EQ(told(replaced(ascii(2), "2.2 0 8", "2.2 x 8")), "FILE:2: 'x' is no value for the format");
  EXPECT_EQ(told(replaced(ascii(2), "\n5 0 0 0 \n", "\n5 0 nan 0 \n")), "FILE:37: nan cannot be a coordinate");
  EXPECT_EQ(told(replaced(ascii(4), "\n0 0 0 0.5 0.25 \n", "\n0 inf 0 0.5 0.25 \n")),
            "FILE:75: inf cannot be a coordinate");
  EXPECT_EQ(told(replaced(ascii(2), "\n5 0 0 0 \n", "\n5 0 0 \n")),
            "FILE:37: a value is missing in a node (number x y z)");
  EXPECT_EQ(told(replaced(ascii(2), "\n5 0 0 0 \n", "\n5 0 0 0 7 \n")),
            "FILE:37: '7' is too much for a node (number x y z)");
  EXPECT_EQ(told(replaced(ascii(2), "\n5 0 0 0 \n", "\n-5 0 0 0 \n")), "FILE:37: -5 cannot be the number of a node");
}

TEST(DamagedMsh, CountsMustFit) {
  EXPECT_EQ(told(replaced(ascii(2), "$Nodes\n27\n", "$Nodes\n26\n")),
            "FILE:40: expected $EndNodes here: the announced counts do not fit the section");
  const std::string absurd = told(replaced(ascii(2), "$Nodes\n27\n", "$Nodes\n999999999999999\n"));
  EXPECT_NE(absurd.find("FILE:13: 999999999999999 cannot be a count in a file of"), std::string::npos) << absurd;
  EXPECT_NE(told(replaced(ascii(2), "$Nodes\n27\n", "$Nodes\n1999\n")).find("the file ends"), std::string::npos);
}

TEST(DamagedMsh, OtherElementsAreRefusedByName) {
  EXPECT_EQ(told(replaced(ascii(2), " 4 2 7 1 ", " 11 2 7 1 ")).substr(0, 57),
            "FILE:69: element type 11 is a tetrahedron of second order");
  for (const bool binary : {false, true}) {
    MshMesh mesh = box_msh(3, 1);
    mesh.elements.push_back({99, 3, 7, {5, 8, 11, 14}});
    const std::string text = told(msh_bytes(mesh, {2, binary}));
    EXPECT_NE(text.find("element type 3 is a quadrangle; only triangles and tetrahedra"), std::string::npos) << text;
    EXPECT_EQ(text.find(binary ? "FILE, byte " : "FILE:"), 0U) << text;
  }
  EXPECT_NE(told(replaced(ascii(4), "\n3 1007 4 24 \n", "\n3 1007 5 24 \n")).find("a hexahedron"), std::string::npos);
}

TEST(DamagedMsh, PartitionedMeshesAreRefused) {
  const std::string text = told(replaced(ascii(4), "$Entities", "$PartitionedEntities"));
  EXPECT_NE(text.find("partitioned by gmsh"), std::string::npos) << text;
  const std::string old = told(replaced(ascii(2), " 4 2 7 1 ", " 4 4 7 1 1 2 "));
  EXPECT_NE(old.find("partitioned by gmsh"), std::string::npos) << old;
}

TEST(DamagedMsh, ElementsInNoPhysicalVolumeAreRefused) {
  MshMesh mesh = box_msh(3, 2);
  mesh.elements.back().physical = 0;
  EXPECT_EQ(
      told(msh_bytes(mesh, {4, true})),
      "FILE: 1 tetrahedra are in no physical volume, though the file has such groups (right, left part): put every "
      "element in one");
}

TEST(DamagedMsh, ASurfaceInSpaceIsNoMeshInTwoDimensions) {
  MshMesh mesh = box_msh(2, 2);
  mesh.nodes.front().point[2] = 0.5;
  EXPECT_NE(told(msh_bytes(mesh, {2, false})).find("z runs from 0 to 0.5"), std::string::npos);
  mesh = box_msh(2, 2);
  mesh.elements.erase(mesh.elements.begin() + 1, mesh.elements.end());
  EXPECT_EQ(told(msh_bytes(mesh, {2, false})), "FILE: the file has neither tetrahedra nor triangles");
}

TEST(DamagedMsh, AMissingFileIsNamed) {
  try {
    read_msh(world(), "/nonexistent/mesh.msh");
    FAIL() << "no error was raised";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "/nonexistent/mesh.msh: cannot be opened: No such file or directory");
  }
  EXPECT_THROW(read_msh(world(), "/"), Error);
}

}  // namespace
}  // namespace malleus
