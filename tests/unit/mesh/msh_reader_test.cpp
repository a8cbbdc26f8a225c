#include "mesh/msh_reader.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "base/error.hpp"
#include "mesh/simplex.hpp"
#include "support/mesh_checksum.hpp"
#include "support/msh_files.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_msh;
using test::msh_bytes;
using test::msh_flavours;
using test::MshFlavour;
using test::MshMesh;
using test::put_file;
using test::ScratchDirectory;
using test::world;

constexpr int cells = 4;

std::vector<Real> volume_of_regions(const Mesh& mesh) {
  std::vector<Real> volumes(mesh.region_names.size(), 0);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const Real volume = simplex_volume<D>(simplex_points<D>(mesh, e));
      EXPECT_GT(volume, 0);
      volumes[static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)])] += volume;
    }
  });
  world().sum_in_place(std::span(volumes));
  return volumes;
}

std::pair<GlobalId, GlobalId> summed(const Mesh& mesh) {
  return {test::checksum_of_nodes(mesh), test::checksum_of_elements(mesh)};
}

/// Sums of nodes and elements from what was written; region names as the reader gives them.
std::pair<GlobalId, GlobalId> expected_checksums(const MshMesh& file, int dim) {
  MeshPiece piece;
  piece.dim = dim;
  piece.region_names = {"right", "left part"};
  if (!world().is_root()) return summed(assemble_mesh(world(), piece).mesh);
  std::map<GlobalId, LocalId> index;
  for (const test::MshNode& node : file.nodes) {
    index[node.tag] = piece.nodes();
    piece.node_numbers.push_back(node.tag);
    piece.coordinates.insert(piece.coordinates.end(), node.point.begin(), node.point.begin() + dim);
  }
  for (const test::MshElement& element : file.elements) {
    if (element.type != (dim == 3 ? 4 : 2)) continue;
    for (const GlobalId node : element.nodes) piece.element_nodes.push_back(index.at(node));
    piece.element_region.push_back(element.physical == 3 ? 0 : 1);
  }
  return summed(assemble_mesh(world(), piece).mesh);
}

class MshFile : public testing::TestWithParam<std::tuple<int, std::size_t>> {
 protected:
  int dim() const { return std::get<0>(GetParam()); }
  MshFlavour flavour() const { return msh_flavours[std::get<1>(GetParam())]; }
  Mesh read(const MshMesh& mesh, Real length_unit = 1) const {
    const ScratchDirectory scratch;
    return build_mesh(world(), read_msh(world(), put_file(scratch, "a.msh", msh_bytes(mesh, flavour())), length_unit));
  }
};

TEST_P(MshFile, IsReadAsItWasWritten) {
  const MshMesh file = box_msh(dim(), cells);
  const Mesh mesh = read(file);
  ASSERT_EQ(mesh.dim, dim());
  EXPECT_EQ(mesh.total_nodes(), static_cast<GlobalId>(file.nodes.size()));
  EXPECT_EQ(mesh.total_elements, dim() == 3 ? 6 * 64 : 2 * 16);
  EXPECT_EQ(summed(mesh), expected_checksums(file, dim()));
  EXPECT_EQ(mesh.region_names, (std::vector<std::string>{"right", "left part"}));
  const Real half = dim() == 3 ? 3.0 : 1.0;
  for (const Real volume : volume_of_regions(mesh)) EXPECT_NEAR(volume, half, 1e-14);
}

TEST_P(MshFile, GroupsCoverTheirSides) {
  const Mesh mesh = read(box_msh(dim(), cells));
  EXPECT_EQ(mesh.group_names, (std::vector<std::string>{"bottom", "top", "9"}));
  std::vector<GlobalId> counts(4, 0);
  const int last = dim() - 1;
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    const int group = mesh.facet_group[static_cast<std::size_t>(f)];
    ++counts[static_cast<std::size_t>(group + 1)];
    for (const LocalId node : mesh.nodes_of_facet(f)) {
      if (group == 0) {
        EXPECT_EQ(mesh.point(node)[last], 0);
      }
      if (group == 1) {
        EXPECT_EQ(mesh.point(node)[last], dim());
      }
      if (group == 2) {
        EXPECT_EQ(mesh.point(node)[0], 0);
      }
    }
  }
  world().sum_in_place(std::span(counts));
  const GlobalId side = dim() == 3 ? 32 : 4;
  EXPECT_EQ(counts, (std::vector<GlobalId>{dim() == 3 ? 3 * side : side, side, side, side}));
}

TEST_P(MshFile, LengthsAreScaled) {
  const Mesh mesh = read(box_msh(dim(), 2), 1e-3);
  Real volume = 0;
  for (const Real part : volume_of_regions(mesh)) volume += part;
  EXPECT_NEAR(volume, dim() == 3 ? 6e-9 : 2e-6, 1e-20);
}

TEST_P(MshFile, IdsArePlacesInTheFile) {
  const MshMesh file = box_msh(dim(), 2);
  const Mesh mesh = read(file);
  GlobalId sum = 0;
  for (const GlobalId id : mesh.element_ids) sum += id;
  EXPECT_EQ(world().sum(sum), mesh.total_elements * (mesh.total_elements - 1) / 2);
}

TEST_P(MshFile, SurfacesAreReadByThemselves) {
  const ScratchDirectory scratch;
  const MshMesh mesh = box_msh(dim(), cells);
  const std::string path = put_file(scratch, "box.msh", msh_bytes(mesh, flavour()));
  const MshSurface surface = read_msh_surface(path, dim());
  using Corners = std::vector<std::array<Real, 3>>;
  std::vector<Corners> expected;
  for (const test::MshElement& element : mesh.elements) {
    if (static_cast<int>(element.nodes.size()) != dim()) continue;
    Corners& corners = expected.emplace_back();
    for (const GlobalId tag : element.nodes) {
      corners.push_back(std::find_if(mesh.nodes.begin(), mesh.nodes.end(), [&](const test::MshNode& node) {
                          return node.tag == tag;
                        })->point);
    }
  }
  std::vector<Corners> found;
  for (const auto& facet : surface.facets) {
    Corners& corners = found.emplace_back();
    for (int k = 0; k < dim(); ++k) {
      const LocalId node = facet[static_cast<std::size_t>(k)];
      corners.push_back(surface.points[static_cast<std::size_t>(node)]);
    }
  }
  std::sort(expected.begin(), expected.end());  // MSH 4 keeps them by entity
  std::sort(found.begin(), found.end());
  EXPECT_GT(found.size(), 0U);
  EXPECT_EQ(found, expected);
}

TEST_P(MshFile, WithoutPhysicalGroupsIsOneRegion) {
  MshMesh file = box_msh(dim(), 2);
  file.names.clear();
  for (test::MshElement& element : file.elements) element.physical = 0;
  const Mesh mesh = read(file);
  EXPECT_EQ(mesh.region_names, std::vector<std::string>{"default"});
  EXPECT_TRUE(mesh.group_names.empty());
}

TEST_P(MshFile, MoreRanksThanElementsAreLegal) {
  MshMesh file = box_msh(dim(), 1);
  const auto type = dim() == 3 ? 4 : 2;
  std::vector<test::MshElement> one;
  for (const test::MshElement& element : file.elements) {
    if (element.type == type && one.empty()) one.push_back(element);
  }
  file.elements = one;
  const Mesh mesh = read(file);
  EXPECT_EQ(mesh.total_elements, 1);
  EXPECT_EQ(mesh.total_nodes(), dim() + 1);
}

INSTANTIATE_TEST_SUITE_P(Flavours, MshFile, testing::Combine(testing::Values(2, 3), testing::Values(0U, 1U, 2U, 3U)));

TEST(MshReader, TheFirstOfTwoPhysicalGroupsHolds) {
  MshMesh file = box_msh(3, 2);
  // MSH 2 lists an element once for each of its groups.
  const std::vector<test::MshElement> original = file.elements;
  for (const test::MshElement& element : original) {
    if (element.type == 15) continue;
    test::MshElement again = element;
    again.physical = element.type == 4 ? 3 : 2;
    file.elements.push_back(again);
  }
  const ScratchDirectory scratch;
  const std::string path = put_file(scratch, "a.msh", msh_bytes(file, {2, true}));
  const Mesh mesh = build_mesh(world(), read_msh(world(), path));
  EXPECT_EQ(mesh.total_elements, 48);
  for (const Real volume : volume_of_regions(mesh)) EXPECT_NEAR(volume, 3.0, 1e-14);
  GlobalId bottom = std::count(mesh.facet_group.begin(), mesh.facet_group.end(), mesh.find_group("bottom"));
  EXPECT_EQ(world().sum(bottom), 8);
}

TEST(MshReader, CarriageReturnsAndForeignSectionsArePassedOver) {
  std::string text = msh_bytes(box_msh(3, 2), {4, false});
  text.insert(text.find("$Entities"), "$Comments\nwritten by hand\n$EndComments\n\n");
  std::string with_returns;
  for (const char c : text) with_returns += c == '\n' ? "\r\n" : std::string(1, c);
  const ScratchDirectory scratch;
  const std::string path = put_file(scratch, "a.msh", with_returns);
  EXPECT_EQ(build_mesh(world(), read_msh(world(), path)).total_elements, 48);
}

TEST(MshReader, LargeFilesAreReadAcrossTheLineIndex) {
  // More lines than one step of the line index, so that ranks start in the middle of the file.
  const MshMesh file = box_msh(3, 12);
  for (const int version : {2, 4}) {
    const ScratchDirectory scratch;
    const std::string path = put_file(scratch, "a.msh", msh_bytes(file, {version, false}));
    const Mesh mesh = build_mesh(world(), read_msh(world(), path));
    EXPECT_EQ(summed(mesh), expected_checksums(file, 3));
  }
}

}  // namespace
}  // namespace malleus
