/// Input that tries the remesher: inverted and flat elements, curved boundaries, odd topologies.

#include <numbers>
#include <random>

#include "base/error.hpp"
#include "meshes.hpp"

namespace malleus {
namespace {

using test::box_mesh;

bool is_inside_box(const RemeshMesh& mesh, LocalId v) {
  for (int i = 0; i < mesh.dimension; ++i) {
    if (mesh.point(v)[i] <= 0 || mesh.point(v)[i] >= 1) return false;
  }
  return true;
}

LocalId count_inverted(const RemeshMesh& mesh) {
  LocalId inverted = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e)
    inverted += test::simplex_measure(mesh, mesh.nodes_of_element(e)) <= 0 ? 1 : 0;
  return inverted;
}

/// Inner nodes thrown about by up to `share` of a cell.
void shake(RemeshMesh& mesh, int cells, Real share) {
  std::mt19937 generator(4);  // NOLINT: the same noise every time
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    if (!is_inside_box(mesh, v)) continue;
    for (int i = 0; i < mesh.dimension; ++i) {
      const Real unit = static_cast<Real>(generator()) / static_cast<Real>(std::mt19937::max()) * 2 - 1;
      mesh.coordinates[static_cast<std::size_t>(v * mesh.dimension + i)] += share / cells * unit;
    }
  }
}

TEST(RemeshHard, TurnsInvertedElements) {
  for (const int dimension : {2, 3}) {
    const int cells = dimension == 2 ? 20 : 8;
    RemeshMesh mesh = box_mesh(dimension, cells);
    shake(mesh, cells, 0.9);
    EXPECT_GT(count_inverted(mesh), mesh.elements() / 20);
    const RemeshReport report = remesh(mesh, Metric::uniform(1.2 / cells));
    EXPECT_GT(report.before.inverted, 0);
    EXPECT_EQ(report.after.inverted, 0);
    test::expect_sound(mesh);
    EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
    EXPECT_GT(report.after.minimum, 0.3);
  }
}

/// A finished mesh turned by 120 degrees over its height has long thin elements everywhere; no bad one may stay.
TEST(RemeshHard, MendsTheWorstElementsOfTwistedBox) {
  RemeshMesh mesh = box_mesh(3, 4);
  const Metric size = Metric::uniform(0.1);
  remesh(mesh, size);
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    auto* x = &mesh.coordinates[static_cast<std::size_t>(3 * v)];
    const Real angle = 2 * std::numbers::pi / 3 * x[2];
    const Real a = x[0] - 0.5;
    const Real b = x[1] - 0.5;
    x[0] = 0.5 + a * std::cos(angle) - b * std::sin(angle);
    x[1] = 0.5 + a * std::sin(angle) + b * std::cos(angle);
  }
  const Real volume = signed_volume(mesh);
  const RemeshReport report = remesh(mesh, size);
  test::expect_sound(mesh);
  EXPECT_NEAR(signed_volume(mesh), volume, 0.015);  // its bent sides are only as fine as the elements
  EXPECT_GT(report.after.minimum, 0.42);
  EXPECT_GT(report.after.mean, 0.82);
}

/// A node pulled through the opposite face of its ball, and one put onto the boundary plane.
TEST(RemeshHard, RepairsFlatElements) {
  RemeshMesh mesh = box_mesh(3, 4);
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    auto* x = &mesh.coordinates[static_cast<std::size_t>(3 * v)];
    if (x[0] == 0.25 && x[1] == 0.5 && x[2] == 0.5) x[0] = 0;
    if (x[0] == 0.75 && x[1] == 0.25 && x[2] == 0.25) x[0] = 0.5;
  }
  EXPECT_GT(count_inverted(mesh), 0);
  const RemeshReport report = remesh(mesh, Metric::uniform(0.2));
  EXPECT_EQ(report.after.inverted, 0);
  test::expect_sound(mesh);
  EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
}

TEST(RemeshHard, ReordersMirroredElements) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 3);
    const auto stride = static_cast<std::size_t>(dimension) + 1;
    for (std::size_t e = 0; e < mesh.element_region.size(); e += 3)
      std::swap(mesh.element_nodes[e * stride], mesh.element_nodes[e * stride + 1]);
    remesh(mesh, Metric::uniform(0.25));
    test::expect_sound(mesh);
    EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
  }
}

/// The unit disc or ball: a box mesh swelled.
RemeshMesh ball_mesh(int dimension, int cells) {
  RemeshMesh mesh = box_mesh(dimension, cells);
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    auto* x = &mesh.coordinates[static_cast<std::size_t>(v * dimension)];
    Real largest = 0;
    Real radius = 0;
    for (int i = 0; i < dimension; ++i) {
      x[i] = 2 * x[i] - 1;
      largest = std::max(largest, std::abs(x[i]));
      radius += x[i] * x[i];
    }
    radius = std::sqrt(radius);
    for (int i = 0; i < dimension; ++i) x[i] *= radius > 0 ? largest / radius : 1;
  }
  return mesh;
}

Real radius_of(const RemeshMesh& mesh, LocalId v) {
  Real square = 0;
  for (int i = 0; i < mesh.dimension; ++i) square += mesh.point(v)[i] * mesh.point(v)[i];
  return std::sqrt(square);
}

class RemeshBall : public testing::TestWithParam<int> {};

TEST_P(RemeshBall, PutsNewNodesOnTheSphere) {
  const int dimension = GetParam();
  RemeshMesh mesh = ball_mesh(dimension, dimension == 2 ? 16 : 8);
  RemeshOptions options;
  options.feature_angle = 60;
  const RemeshReport report = remesh(mesh, Metric::uniform(dimension == 2 ? 0.04 : 0.15), options);
  test::expect_sound(mesh);
  EXPECT_GT(report.after.minimum, 0.3);
  std::set<LocalId> on_boundary;
  for (const auto& [face, elements] : test::faces_of(mesh)) {
    if (elements.size() == 1) on_boundary.insert(face.begin(), face.end());
  }
  Real largest = 0;
  for (const LocalId v : on_boundary) largest = std::max(largest, std::abs(radius_of(mesh, v) - 1));
  // The chords of the input are up to 0.01 (2D) and 0.05 (3D) inside.
  EXPECT_LT(largest, dimension == 2 ? 1e-5 : 2e-3);
}

TEST_P(RemeshBall, KeepsTheVolumeWhereAsked) {
  const int dimension = GetParam();
  RemeshMesh mesh = ball_mesh(dimension, dimension == 2 ? 16 : 8);
  const Real before = signed_volume(mesh);
  RemeshOptions options;
  options.feature_angle = 60;
  options.keep_volume = true;
  for (const Real size : {0.2, 0.3, 0.25}) {
    const RemeshReport report = remesh(mesh, Metric::uniform(size), options);
    EXPECT_LT(report.volume_error, 1e-12);
    EXPECT_NEAR(signed_volume(mesh), before, 1e-12 * before);
    test::expect_sound(mesh);
  }
}

/// Chords lose volume with the square of their length: so little that nodes hardly leave the surface to make up for it.
TEST_P(RemeshBall, LosesLessVolumeWithAFinerSurface) {
  const int dimension = GetParam();
  std::vector<Real> lost;
  for (const Real finer : {1.0, 1.3}) {
    RemeshMesh mesh = ball_mesh(dimension, dimension == 2 ? 48 : 14);
    const Real before = signed_volume(mesh);
    RemeshOptions options;
    options.feature_angle = 60;
    options.surface_finer = finer;
    remesh(mesh, Metric::uniform(0.2), options);
    test::expect_sound(mesh);
    lost.push_back(before - signed_volume(mesh));
  }
  EXPECT_GT(lost[0], 0);
  EXPECT_LT(lost[1], 0.75 * lost[0]);
}

/// A ball pressed flat on two sides: volume comes back where the surface is round, the flat sides do not move.
TEST_P(RemeshBall, KeepsTheVolumeWithoutBulgingFlatSides) {
  const int dimension = GetParam();
  constexpr Real height = 0.8;
  RemeshMesh mesh = ball_mesh(dimension, dimension == 2 ? 32 : 12);
  const auto up = static_cast<std::size_t>(dimension) - 1;
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    Real* x = &mesh.coordinates[static_cast<std::size_t>(v * dimension)];
    const Real steepness = std::abs(x[up]) / std::max(radius_of(mesh, v), 1e-300);
    for (int i = 0; i < dimension && steepness > height; ++i) x[i] *= height / steepness;
  }
  const Real before = signed_volume(mesh);
  RemeshOptions options;
  options.feature_angle = 80;
  options.keep_volume = true;
  remesh(mesh, Metric::uniform(0.2), options);
  EXPECT_NEAR(signed_volume(mesh), before, 1e-12 * before);
  int on_flat = 0;
  for (std::size_t i = up; i < mesh.coordinates.size(); i += up + 1) {
    Real aside = 0;
    for (std::size_t c = 1; c <= up; ++c) aside = std::max(aside, std::abs(mesh.coordinates[i - c]));
    if (aside > 0.25 || std::abs(mesh.coordinates[i]) < height - 0.05) continue;
    EXPECT_NEAR(std::abs(mesh.coordinates[i]), height, 1e-12);
    ++on_flat;
  }
  EXPECT_GE(on_flat, 4);
}

TEST_P(RemeshBall, StaysWithinTheHausdorffBound) {
  const int dimension = GetParam();
  RemeshMesh mesh = ball_mesh(dimension, dimension == 2 ? 32 : 12);
  RemeshOptions options;
  options.feature_angle = 60;
  options.hausdorff = 0.01;
  remesh(mesh, Metric::uniform(1), options);
  test::expect_sound(mesh);
  for (const auto& [face, elements] : test::faces_of(mesh)) {
    if (elements.size() != 1) continue;
    Real square = 0;
    for (int i = 0; i < dimension; ++i) {
      Real centre = 0;
      for (const LocalId v : face) centre += mesh.point(v)[i] / dimension;
      square += centre * centre;
    }
    EXPECT_GT(std::sqrt(square), 1 - 0.012);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, RemeshBall, testing::Values(2, 3));

/// A quarter of a ring beside a straight piece: features between them stay, the arcs stay round.
TEST(RemeshHard, KeepsCornersOfACurvedOutline) {
  RemeshMesh mesh = box_mesh(2, 8);
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    auto* x = &mesh.coordinates[static_cast<std::size_t>(2 * v)];
    const Real radius = 1 + x[0];
    const Real angle = x[1] * std::numbers::pi / 2;
    x[0] = radius * std::cos(angle);
    x[1] = radius * std::sin(angle);
  }
  remesh(mesh, Metric::uniform(0.07));
  test::expect_sound(mesh);
  ASSERT_EQ(mesh.corners.size(), 4U);
  for (const LocalId v : mesh.corners) {
    const Real r = radius_of(mesh, v);
    EXPECT_LT(std::min(std::abs(r - 1), std::abs(r - 2)), 1e-12);
  }
  EXPECT_NEAR(signed_volume(mesh), 3 * std::numbers::pi / 4, 3e-3);
}

TEST(RemeshHard, TakesASingleElement) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 1);
    mesh.element_nodes.resize(static_cast<std::size_t>(dimension) + 1);
    mesh.element_region.resize(1);
    const Real before = std::abs(signed_volume(mesh));
    const RemeshReport report = remesh(mesh, Metric::uniform(0.3));
    test::expect_sound(mesh);
    EXPECT_NEAR(signed_volume(mesh), before, 1e-13);
    EXPECT_GT(report.unused_nodes, 0);
    remesh(mesh, Metric::uniform(10));
    test::expect_sound(mesh);
    EXPECT_NEAR(signed_volume(mesh), before, 1e-13);
  }
}

/// Two tetrahedra that touch along an edge, two that touch in a node: neither may come apart or grow together.
TEST(RemeshHard, KeepsPinchedBodies) {
  RemeshMesh mesh;
  mesh.coordinates = {0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0};
  mesh.element_nodes = {0, 2, 3, 1, 0, 4, 5, 1};
  mesh.element_region = {1, 1};
  remesh(mesh, Metric::uniform(0.3));
  test::expect_sound(mesh);
  EXPECT_NEAR(signed_volume(mesh), 1.0 / 3, 1e-13);
}

}  // namespace
}  // namespace malleus
