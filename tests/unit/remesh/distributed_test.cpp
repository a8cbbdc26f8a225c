#include "remesh/distributed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mesh/statistics.hpp"
#include "mesh/verify.hpp"
#include "partition/interface_release.hpp"
#include "partition/migrate.hpp"
#include "remesh/error_metric.hpp"
#include "remesh/selection.hpp"
#include "remesh/subdivide.hpp"
#include "support/box_mesh.hpp"
#include "support/mesh_checksum.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

/// A box in two regions, split in the middle of x, the interface named; fields whose values follow from the place.
struct Scene {
  Mesh mesh;
  FieldStore fields;

  explicit Scene(int dim, int cells = 6) {
    test::BoxMeshOptions box;
    box.dim = dim;
    box.cells = {cells, cells, cells};
    MeshPiece piece = test::box_piece(world(), box);
    piece.region_names = {"left", "right"};
    piece.group_names.push_back("between");
    const auto n = static_cast<std::size_t>(dim) + 1;
    for (std::size_t e = 0; e < piece.element_region.size(); ++e) {
      std::vector<LocalId> on_plane;
      Real centre = 0;
      for (std::size_t k = 0; k < n; ++k) {
        const LocalId node = piece.element_nodes[e * n + k];
        const Real x = piece.coordinates[static_cast<std::size_t>(node * dim)];
        centre += x / static_cast<Real>(n);
        if (x == 0.5) on_plane.push_back(node);
      }
      piece.element_region[e] = centre < 0.5 ? 0 : 1;
      if (centre > 0.5 || on_plane.size() != n - 1) continue;
      piece.facet_nodes.insert(piece.facet_nodes.end(), on_plane.begin(), on_plane.end());
      piece.facet_group.push_back(static_cast<std::int32_t>(piece.group_names.size()) - 1);
    }
    mesh = assemble_mesh(world(), piece).mesh;
    Field& place = fields.declare(mesh, {"place", "m", Support::node, dim});
    std::copy(mesh.coordinates.begin(), mesh.coordinates.end(), place.values().begin());
    Field& side = fields.declare(mesh, {"side", "1", Support::element, 1, Transfer::conserve});
    for (LocalId e = 0; e < mesh.elements(); ++e) *side.at(e) = 1 + mesh.element_region[static_cast<std::size_t>(e)];
    fields.declare(mesh, {"gone", "1", Support::node, 1, Transfer::recompute}).values();
  }

  void expect_sound() {
    verify_mesh(world(), mesh);
    const MeshStatistics statistics = mesh_statistics(world(), mesh);
    EXPECT_NEAR(statistics.volume, 1, 1e-12);
    for (const auto& region : statistics.regions) EXPECT_NEAR(region.volume, 0.5, 1e-12) << region.name;
    for (const auto& group : statistics.groups) EXPECT_NEAR(group.area, 1, 1e-12) << group.name;
    EXPECT_EQ(statistics.unnamed_exterior_facets, 0);
    const auto place = fields["place"].values();
    for (std::size_t i = 0; i < place.size(); ++i) ASSERT_NEAR(place[i], mesh.coordinates[i], 1e-12);
    for (LocalId e = 0; e < mesh.elements(); ++e)
      ASSERT_NEAR(*fields["side"].at(e), 1 + mesh.element_region[static_cast<std::size_t>(e)], 1e-9);
    EXPECT_FALSE(fields.has(metric_field_name));
    EXPECT_EQ(fields.all().size(), 3U);
  }
};

class Distributed : public testing::TestWithParam<int> {
 protected:
  Real size() const { return GetParam() == 2 ? 0.03 : 0.1; }
};

TEST_P(Distributed, ABoxIsRefinedAlikeInsideAndOnFormerInterfaces) {
  Scene scene(GetParam());
  const DistributedRemeshReport report = remesh_distributed(world(), scene.mesh, scene.fields, Metric::uniform(size()));
  scene.expect_sound();
  EXPECT_EQ(report.nodes_after, scene.mesh.total_nodes());
  EXPECT_EQ(report.interface_nodes, 0);
  EXPECT_EQ(report.after.inverted, 0);
  EXPECT_GT(report.after.quality_min, GetParam() == 2 ? 0.55 : 0.42);
  EXPECT_GT(report.after.quality_mean, GetParam() == 2 ? 0.93 : 0.85);
  EXPECT_GT(report.after.conforming, GetParam() == 2 ? 0.97 : 0.92);
  EXPECT_LT(report.after.edge_max, 2.2);
  const Real mean = static_cast<Real>(scene.mesh.total_elements) / world().size();
  EXPECT_LE(static_cast<Real>(world().max(static_cast<GlobalId>(scene.mesh.elements()))), 1.1 * mean + 10);
}

TEST_P(Distributed, TheSameTwiceGivesTheSameMesh) {
  Scene a(GetParam());
  Scene b(GetParam());
  remesh_distributed(world(), a.mesh, a.fields, Metric::uniform(size()));
  remesh_distributed(world(), b.mesh, b.fields, Metric::uniform(size()));
  EXPECT_EQ(a.mesh.element_nodes, b.mesh.element_nodes);
  EXPECT_EQ(a.mesh.coordinates, b.mesh.coordinates);
  EXPECT_EQ(test::checksum_of_groups(a.mesh), test::checksum_of_groups(b.mesh));
}

TEST_P(Distributed, SizesThatVaryAreMetAndCoarsenToo) {
  Scene scene(GetParam(), 10);
  std::vector<Real> sizes;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node)
    sizes.push_back((GetParam() == 2 ? 0.03 : 0.1) + 0.2 * scene.mesh.point(node)[0]);
  Metric metric = Metric::per_node(sizes);
  limit_gradation(world(), scene.mesh, metric, 1.3);
  const DistributedRemeshReport report = remesh_distributed(world(), scene.mesh, scene.fields, metric);
  scene.expect_sound();
  EXPECT_GT(report.after.conforming, 0.85);
  EXPECT_GT(report.after.quality_min, 0.3);
}

TEST_P(Distributed, MoreRanksThanThereIsWorkAreLeftEmpty) {
  Scene scene(GetParam(), 2);
  const DistributedRemeshReport report = remesh_distributed(world(), scene.mesh, scene.fields, Metric::uniform(0.5));
  scene.expect_sound();
  EXPECT_GT(report.elements_after, 0);
}

TEST_P(Distributed, AKeptSurfaceKeepsItsFacets) {
  Scene scene(GetParam());
  const GlobalId before = test::checksum_of_groups(scene.mesh);
  DistributedRemeshOptions options;
  options.local.keep_surface = true;
  remesh_distributed(world(), scene.mesh, scene.fields, Metric::uniform(0.12), options);
  scene.expect_sound();
  EXPECT_EQ(test::checksum_of_groups(scene.mesh), before);
}

TEST_P(Distributed, HalvingKeepsAll) {
  Scene scene(GetParam(), 4);
  const GlobalId before = scene.mesh.total_elements;
  subdivide(world(), scene.mesh, scene.fields);
  subdivide(world(), scene.mesh, scene.fields);
  EXPECT_EQ(scene.mesh.total_elements, before * (GetParam() == 2 ? 16 : 64));
  EXPECT_EQ(scene.mesh.total_nodes(), GetParam() == 2 ? 17 * 17 : 17 * 17 * 17);
  scene.expect_sound();
}

TEST_P(Distributed, SizesOfANodeCountAreMet) {
  Scene scene(GetParam(), 8);
  Metric metric = current_sizes(world(), scene.mesh);
  const Real wanted = GetParam() == 2 ? 1000 : 1500;
  scale_to_nodes(world(), scene.mesh, metric, wanted);
  const DistributedRemeshReport report = remesh_distributed(world(), scene.mesh, scene.fields, metric);
  EXPECT_NEAR(static_cast<Real>(report.nodes_after), wanted, 0.2 * wanted);
}

/// The error of interpolating x^4 falls when the sizes follow its curvature.
TEST_P(Distributed, AnErrorMetricGathersNodesWhereAFieldBends) {
  Scene scene(GetParam(), 10);
  Field& bend = scene.fields.declare(scene.mesh, {"bend", "1", Support::node, 1});
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) *bend.at(node) = std::pow(scene.mesh.point(node)[0], 6);
  const Metric metric = error_metric(world(), scene.mesh, bend, 1000, {});
  Real left = 0;
  Real right = 1e300;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    const Real x = scene.mesh.point(node)[0];
    const Real h = metric.values()[static_cast<std::size_t>(node)];
    if (x < 0.3) left = std::max(left, h);
    if (x > 0.8) right = std::min(right, h);
  }
  EXPECT_GT(world().max(left), 2 * world().min(right));
}

TEST_P(Distributed, GradationDoesNotStopAtInterfaces) {
  Scene scene(GetParam(), 8);
  std::vector<Real> sizes;
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node)
    sizes.push_back(scene.mesh.point(node)[0] == 0 ? 0.01 : 1.0);
  Metric metric = Metric::per_node(sizes);
  limit_gradation(world(), scene.mesh, metric, 1.3);
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
    const Real exact = 0.01 + std::log(1.3) * scene.mesh.point(node)[0];
    EXPECT_NEAR(metric.values()[static_cast<std::size_t>(node)], exact, 1e-3 * exact + 1e-12);
  }
}

TEST_P(Distributed, InterfacesMoveAwayFromMarks) {
  Scene scene(GetParam(), 8);
  const std::vector<std::uint8_t> marks = shared_nodes(scene.mesh);
  Field& mark = scene.fields.declare(scene.mesh, {"mark", "1", Support::node, 1});
  mark.assign({marks.begin(), marks.end()});
  const auto count = static_cast<GlobalId>(std::count(marks.begin(), marks.end(), 1));
  const std::vector<Real> work(static_cast<std::size_t>(scene.mesh.elements()), 1);
  ReleaseOptions options;
  options.aim = ReleaseAim::most_released;
  options.layers = 2;
  migrate(world(), scene.mesh, scene.fields, move_interfaces_inside(world(), scene.mesh, work, options, marks).parts);
  GlobalId left = 0;
  const std::vector<std::uint8_t> shared = shared_nodes(scene.mesh);
  for (LocalId node = 0; node < scene.mesh.nodes(); ++node)
    left += *mark.at(node) == 1 && shared[static_cast<std::size_t>(node)] == 1 ? 1 : 0;
  if (world().size() > 1) {
    EXPECT_LT(world().sum(left), world().sum(count) / 4);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Distributed, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
