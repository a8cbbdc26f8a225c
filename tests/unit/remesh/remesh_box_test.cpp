#include "base/error.hpp"
#include "meshes.hpp"

namespace malleus {
namespace {

using test::box_mesh;

struct BoxCase {
  int dimension;
  int cells;
  Real size;
};

class RemeshBox : public testing::TestWithParam<BoxCase> {};

TEST_P(RemeshBox, MeetsTheSizeWithGoodElementsAndKeepsTheBox) {
  const auto [dimension, cells, size] = GetParam();
  RemeshMesh mesh = box_mesh(dimension, cells);
  test::group_sides(mesh);
  const RemeshReport report = remesh(mesh, Metric::uniform(size));
  test::expect_sound(mesh);
  EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
  const auto areas = test::group_areas(mesh);
  ASSERT_EQ(areas.size(), static_cast<std::size_t>(2 * dimension));
  for (const auto& [group, area] : areas) EXPECT_NEAR(area, 1, 1e-12) << "group " << group;
  EXPECT_GT(report.after.minimum, dimension == 2 ? 0.5 : 0.4);
  EXPECT_GT(report.after.mean, 0.85);
  EXPECT_GT(report.after.conforming, 0.92);
  EXPECT_EQ(report.after.inverted, 0);
  EXPECT_EQ(report.nodes_after, mesh.nodes());
}

INSTANTIATE_TEST_SUITE_P(Sizes, RemeshBox,
                         testing::Values(BoxCase{2, 4, 0.05}, BoxCase{2, 40, 0.1}, BoxCase{2, 1, 0.1},
                                         BoxCase{3, 3, 0.12}, BoxCase{3, 10, 0.25}, BoxCase{3, 1, 0.2}),
                         [](const auto& tested) {
                           return std::to_string(tested.param.dimension) + "D_from_" +
                                  std::to_string(tested.param.cells);
                         });

TEST(Remesh, GivesTheSameBytesTwice) {
  for (const int dimension : {2, 3}) {
    RemeshMesh first = box_mesh(dimension, 3);
    RemeshMesh second = box_mesh(dimension, 3);
    remesh(first, Metric::uniform(0.15));
    remesh(second, Metric::uniform(0.15));
    EXPECT_EQ(first.coordinates, second.coordinates);
    EXPECT_EQ(first.element_nodes, second.element_nodes);
  }
}

TEST(Remesh, FollowsASizePerNode) {
  RemeshMesh mesh = box_mesh(3, 4);
  std::vector<Real> sizes;
  for (LocalId v = 0; v < mesh.nodes(); ++v) sizes.push_back(0.08 + 0.25 * mesh.point(v)[0]);
  const RemeshReport report = remesh(mesh, Metric::per_node(std::move(sizes)));
  test::expect_sound(mesh);
  EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
  EXPECT_GT(report.after.conforming, 0.9);
  LocalId left = 0;
  for (LocalId v = 0; v < mesh.nodes(); ++v) left += mesh.point(v)[0] < 0.5 ? 1 : 0;
  EXPECT_GT(left, 3 * (mesh.nodes() - left));
}

TEST(Remesh, FollowsATensor) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 4);
    std::vector<Real> tensors;
    for (LocalId v = 0; v < mesh.nodes(); ++v) {
      if (dimension == 2) tensors.insert(tensors.end(), {1 / (0.02 * 0.02), 0, 1 / (0.2 * 0.2)});
      if (dimension == 3) tensors.insert(tensors.end(), {1 / (0.04 * 0.04), 0, 1 / (0.3 * 0.3), 0, 0, 1 / (0.3 * 0.3)});
    }
    const RemeshReport report = remesh(mesh, Metric::tensors(dimension, std::move(tensors)));
    test::expect_sound(mesh);
    EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
    EXPECT_GT(report.after.minimum, 0.3);
    EXPECT_GT(report.after.conforming, 0.9);
  }
}

/// Two regions side by side, and a listed inner surface in the first.
TEST(Remesh, KeepsRegionsAndInnerSurfaces) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 4);
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      Real x = 0;
      for (const LocalId v : mesh.nodes_of_element(e)) x += mesh.point(v)[0] / (dimension + 1);
      mesh.element_region[static_cast<std::size_t>(e)] = x < 0.5 ? 7 : 3;
    }
    for (const auto& [face, elements] : test::faces_of(mesh)) {
      const bool inner = std::all_of(face.begin(), face.end(), [&](LocalId v) { return mesh.point(v)[0] == 0.25; });
      if (!inner) continue;
      mesh.facet_nodes.insert(mesh.facet_nodes.end(), face.begin(), face.end());
      mesh.facet_group.push_back(11);
    }
    remesh(mesh, Metric::uniform(0.13));
    test::expect_sound(mesh);
    EXPECT_NEAR(signed_volume(mesh, 7), 0.5, 1e-12);
    EXPECT_NEAR(signed_volume(mesh, 3), 0.5, 1e-12);
    EXPECT_NEAR(test::group_areas(mesh)[11], 1, 1e-12);
  }
}

TEST(Remesh, LeavesFrozenInterfacesAlone) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 4);
    mesh.frozen.assign(static_cast<std::size_t>(mesh.nodes()), 0);
    std::set<std::vector<Real>> before;
    for (LocalId v = 0; v < mesh.nodes(); ++v) {
      if (mesh.point(v)[0] != 1) continue;
      mesh.frozen[static_cast<std::size_t>(v)] = 1;
      before.insert({mesh.point(v), mesh.point(v) + dimension});
    }
    const auto count_facets = [](const RemeshMesh& m) {
      std::size_t n = 0;
      for (const auto& [face, elements] : test::faces_of(m)) {
        n += elements.size() == 1 &&
             std::all_of(face.begin(), face.end(), [&](LocalId v) { return m.point(v)[0] == 1; });
      }
      return n;
    };
    const std::size_t facets_before = count_facets(mesh);
    remesh(mesh, Metric::uniform(0.1));
    test::expect_sound(mesh);
    std::set<std::vector<Real>> after;
    for (LocalId v = 0; v < mesh.nodes(); ++v) {
      if (mesh.point(v)[0] == 1) after.insert({mesh.point(v), mesh.point(v) + dimension});
      EXPECT_EQ(mesh.frozen[static_cast<std::size_t>(v)], mesh.point(v)[0] == 1 ? 1 : 0);
    }
    EXPECT_EQ(before, after);
    EXPECT_EQ(count_facets(mesh), facets_before);
  }
}

TEST(Remesh, KeepsTheSurfaceWhereAsked) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 4);
    test::group_sides(mesh);
    const LocalId facets = mesh.facets();
    RemeshOptions options;
    options.keep_surface = true;
    const RemeshReport report = remesh(mesh, Metric::uniform(0.1), options);
    test::expect_sound(mesh);
    EXPECT_EQ(mesh.facets(), facets);
    EXPECT_TRUE(mesh.frozen.empty());
    EXPECT_GT(report.splits, 0);
  }
}

TEST(Remesh, RefusesWhatIsNoMesh) {
  RemeshMesh mesh = box_mesh(3, 1);
  mesh.element_nodes[0] = 99;
  EXPECT_THROW(remesh(mesh, Metric::uniform(0.5)), InputError);
  mesh = box_mesh(3, 1);
  mesh.element_nodes[0] = mesh.element_nodes[1];
  EXPECT_THROW(remesh(mesh, Metric::uniform(0.5)), InputError);
  mesh = box_mesh(2, 1);
  mesh.element_nodes.insert(mesh.element_nodes.end(), mesh.element_nodes.begin(), mesh.element_nodes.begin() + 3);
  mesh.element_nodes.insert(mesh.element_nodes.end(), mesh.element_nodes.begin(), mesh.element_nodes.begin() + 3);
  mesh.element_region.insert(mesh.element_region.end(), 2, 1);
  EXPECT_THROW(remesh(mesh, Metric::uniform(0.5)), InputError);
  mesh = box_mesh(2, 1);
  EXPECT_THROW(remesh(mesh, Metric::per_node({0.1, 0.1})), InputError);
  EXPECT_THROW(Metric::uniform(0), InputError);
  EXPECT_THROW(Metric::tensors(2, {1, 2, 1}), InputError);
}

TEST(Remesh, TakesAnEmptyMesh) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh;
    mesh.dimension = dimension;
    const RemeshReport report = remesh(mesh, Metric::uniform(0.1));
    EXPECT_EQ(mesh.nodes(), 0);
    EXPECT_EQ(report.elements_after, 0);
  }
}

}  // namespace
}  // namespace malleus
