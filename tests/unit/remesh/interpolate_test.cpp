#include "remesh/interpolate.hpp"

#include "meshes.hpp"

namespace malleus {
namespace {

using test::box_mesh;

class Interpolate : public testing::TestWithParam<int> {};

TEST_P(Interpolate, ReproducesConstantsAndLinearFields) {
  const int dimension = GetParam();
  const RemeshMesh old_mesh = box_mesh(dimension, 5);
  RemeshMesh new_mesh = old_mesh;
  remesh(new_mesh, Metric::uniform(0.13));
  const auto field = [](const Real* x) { return 3 + 2 * x[0] - 7 * x[1]; };
  std::vector<Real> values;
  for (LocalId v = 0; v < old_mesh.nodes(); ++v) values.insert(values.end(), {5.0, field(old_mesh.point(v))});
  const PointLocator locator(old_mesh);
  const auto at = locator.locate(new_mesh.coordinates);
  const auto result = interpolate(old_mesh, at, values, 2);
  for (LocalId v = 0; v < new_mesh.nodes(); ++v) {
    EXPECT_NEAR(result[2 * static_cast<std::size_t>(v)], 5, 1e-12);
    EXPECT_NEAR(result[2 * static_cast<std::size_t>(v) + 1], field(new_mesh.point(v)), 1e-11);
  }
}

TEST_P(Interpolate, StaysInRangeOutsideOfTheMesh) {
  const int dimension = GetParam();
  const RemeshMesh mesh = box_mesh(dimension, 3);
  std::vector<Real> values;
  for (LocalId v = 0; v < mesh.nodes(); ++v) values.push_back(mesh.point(v)[0]);
  const std::vector<Real> points = dimension == 2 ? std::vector<Real>{1.2, 0.5, -3, 0.5, 0.4, 7}
                                                  : std::vector<Real>{1.2, 0.5, 0.5, -3, 0.5, 0.5, 0.4, 7, -5};
  const auto result = interpolate(mesh, PointLocator(mesh).locate(points), values, 1);
  EXPECT_NEAR(result[0], 1, 1e-12);
  EXPECT_NEAR(result[1], 0, 1e-12);
  EXPECT_GE(result[2], 0);
  EXPECT_LE(result[2], 1);
}

TEST_P(Interpolate, ConservesElementFieldsAndKeepsThemPositive) {
  const int dimension = GetParam();
  const RemeshMesh old_mesh = box_mesh(dimension, 5);
  RemeshMesh new_mesh = old_mesh;
  remesh(new_mesh, Metric::uniform(0.17));
  std::vector<Real> values;
  Real integral = 0;
  Real signed_integral = 0;
  for (LocalId e = 0; e < old_mesh.elements(); ++e) {
    const Real value = 1e-3 + (e % 7 == 0 ? 1.0 : 0.0);
    values.insert(values.end(), {value, 0.3 - value, 4});
    const Real volume = test::simplex_measure(old_mesh, old_mesh.nodes_of_element(e));
    integral += value * volume;
    signed_integral += (0.3 - value) * volume;
  }
  const auto result = transfer_elements(old_mesh, new_mesh, values, 3, true);
  for (LocalId e = 0; e < new_mesh.elements(); ++e) {
    const auto at = 3 * static_cast<std::size_t>(e);
    const Real volume = test::simplex_measure(new_mesh, new_mesh.nodes_of_element(e));
    EXPECT_GT(result[at], 0);
    EXPECT_NEAR(result[at + 2], 4, 1e-12);
    integral -= result[at] * volume;
    signed_integral -= result[at + 1] * volume;
  }
  EXPECT_NEAR(integral, 0, 1e-12);
  EXPECT_NEAR(signed_integral, 0, 1e-12);
}

/// Two bodies that touch without sharing nodes: each keeps its own values.
TEST_P(Interpolate, DoesNotMixTouchingBodies) {
  const int dimension = GetParam();
  RemeshMesh mesh = box_mesh(dimension, 3);
  const RemeshMesh second = box_mesh(dimension, 2);
  const LocalId first_nodes = mesh.nodes();
  for (std::size_t i = 0; i < second.coordinates.size(); ++i)
    mesh.coordinates.push_back(second.coordinates[i] + (i % static_cast<std::size_t>(dimension) == 0 ? 1 : 0));
  for (const LocalId v : second.element_nodes) mesh.element_nodes.push_back(v + first_nodes);
  mesh.element_region.insert(mesh.element_region.end(), second.element_region.size(), 2);
  std::vector<Real> values(static_cast<std::size_t>(mesh.nodes()), 10);
  std::fill(values.begin() + first_nodes, values.end(), 20);
  std::vector<Real> points = {1, 0.4, 1, 0.4};
  if (dimension == 3) points = {1, 0.4, 0.3, 1, 0.4, 0.3};
  const auto at = PointLocator(mesh).locate(points, std::vector<std::int32_t>{1, 2});
  const auto result = interpolate(mesh, at, values, 1);
  EXPECT_NEAR(result[0], 10, 1e-12);
  EXPECT_NEAR(result[1], 20, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Interpolate, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
