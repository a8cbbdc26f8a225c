#include "fem/boundary_conditions.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

/// The unit box turned by `turn` after assembly.
Mesh turned_box(int dim, const Eigen::Matrix3d& turn) {
  Mesh mesh = box_mesh(world(), {.dim = dim, .cells = {3, 4, 2}});
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    for (int d = 0; d < dim; ++d) x[d] = mesh.point(node)[d];
    x = turn * x;
    for (int d = 0; d < dim; ++d) mesh.point(node)[d] = x[d];
  }
  return mesh;
}

Eigen::Matrix3d turn_of(int dim) {
  if (dim == 2) return Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
}

/// Number of box planes of the listed axes' low sides that a node lies on.
int planes_at(const Mesh& mesh, LocalId node, const Eigen::Matrix3d& turn, int axes) {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  for (int d = 0; d < mesh.dim; ++d) x[d] = mesh.point(node)[d];
  x = turn.transpose() * x;
  int count = 0;
  for (int d = 0; d < axes; ++d) count += x[d] < 1e-9 ? 1 : 0;
  return count;
}

class Planes : public testing::TestWithParam<int> {};

TEST_P(Planes, SymmetryOnSeveralObliquePlanesFixesEachNormal) {
  const int dim = GetParam();
  const Eigen::Matrix3d turn = turn_of(dim);
  const Mesh mesh = turned_box(dim, turn);
  std::vector<BoundaryCondition> conditions;
  for (const char* name : {"x_low", "y_low", "z_low"}) {
    if (mesh.find_group(name) >= 0) conditions.push_back({mesh.find_group(name), ConditionKind::symmetry, {}});
  }
  const NodeConstraints constraints = make_constraints(world(), mesh, Geometry::plane, conditions, 0);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const int planes = planes_at(mesh, node, turn, dim);
    ASSERT_EQ(constraints.fixed_directions(node), planes);
    if (planes != 1) continue;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (int d = 0; d < dim; ++d) normal[d] = constraints.directions(node)[static_cast<std::size_t>(d)];
    EXPECT_NEAR((turn.transpose() * normal).cwiseAbs().maxCoeff(), 1, 1e-12);
  }
}

TEST_P(Planes, OneGroupOfSeveralPlanesFixesTheSame) {
  const int dim = GetParam();
  const Eigen::Matrix3d turn = turn_of(dim);
  Mesh mesh = turned_box(dim, turn);
  const std::int32_t x_low = mesh.find_group("x_low");
  for (auto& group : mesh.facet_group) {
    for (const char* name : {"y_low", "z_low"}) {
      if (group >= 0 && group == mesh.find_group(name)) group = x_low;
    }
  }
  const std::vector<BoundaryCondition> conditions = {{x_low, ConditionKind::symmetry, {}}};
  const NodeConstraints constraints = make_constraints(world(), mesh, Geometry::plane, conditions, 0);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    EXPECT_EQ(constraints.fixed_directions(node), planes_at(mesh, node, turn, dim));
  }
}

TEST_P(Planes, WallWinsOverVelocityOverSymmetry) {
  const int dim = GetParam();
  const Mesh mesh = turned_box(dim, Eigen::Matrix3d::Identity());
  std::vector<BoundaryCondition> conditions(3);
  conditions[0] = {mesh.find_group("x_low"), ConditionKind::symmetry, {}};
  conditions[1].group = mesh.find_group("y_low");
  conditions[1].kind = ConditionKind::velocity;
  conditions[1].velocity[0] = Expression::parse("2+y");
  conditions[1].velocity[1] = Expression::parse("3*t");
  conditions[2].group = mesh.find_group("x_high");
  const NodeConstraints constraints = make_constraints(world(), mesh, Geometry::plane, conditions, 2);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real* x = mesh.point(node);
    std::array<Real, 3> v = {7, 8, 9};
    constraints.impose(node, v.data());
    if (x[0] > 1 - 1e-9) {
      EXPECT_EQ(constraints.fixed_directions(node), dim);
      EXPECT_NEAR(std::abs(v[0]) + std::abs(v[1]), 0, 1e-15);
    } else if (x[1] < 1e-9) {
      EXPECT_EQ(constraints.fixed_directions(node), 2);
      EXPECT_NEAR(v[0], 2, 1e-15);
      EXPECT_NEAR(v[1], 6, 1e-15);
      EXPECT_EQ(v[2], 9);  // free in 3D, untouched in 2D
    } else if (x[0] < 1e-9) {
      EXPECT_EQ(constraints.fixed_directions(node), 1);
      EXPECT_NEAR(v[0], 0, 1e-15);
      EXPECT_NEAR(v[1], 8, 1e-15);
    } else {
      EXPECT_EQ(constraints.fixed_directions(node), 0);
    }
  }
}

TEST_P(Planes, GateLeavesTheNormalFree) {
  const int dim = GetParam();
  const Eigen::Matrix3d turn = turn_of(dim);
  const Mesh mesh = turned_box(dim, turn);
  const std::vector<BoundaryCondition> conditions = {{mesh.find_group("x_low"), ConditionKind::no_tangential, {}}};
  const NodeConstraints constraints = make_constraints(world(), mesh, Geometry::plane, conditions, 0);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (planes_at(mesh, node, turn, 1) == 0) continue;
    ASSERT_EQ(constraints.fixed_directions(node), dim - 1);
    Eigen::Vector3d normal = turn.col(0);
    const Eigen::Vector3d before = normal;
    constraints.project(node, normal.data());
    EXPECT_LT((normal - before).head(dim).norm(), 1e-12);
  }
}

TEST_P(Planes, AreaFluxAndPressureForce) {
  const int dim = GetParam();
  const Mesh mesh = turned_box(dim, turn_of(dim));
  const auto facets = facets_of_group(mesh, mesh.find_group("x_high"));
  EXPECT_NEAR(boundary_area(world(), mesh, Geometry::plane, facets), 1, 1e-13);
  std::vector<Real> velocity;
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    for (int d = 0; d < dim; ++d) velocity.push_back(3 * turn_of(dim)(d, 0));
  }
  EXPECT_NEAR(boundary_flux(world(), mesh, Geometry::plane, facets, velocity, dim), 3, 1e-13);
  BoundaryLoad load;
  load.group = mesh.find_group("x_high");
  load.pressure = Expression(5);
  for (const FacetTraction& traction : make_tractions(world(), mesh, std::vector{load}, 0)) {
    for (int d = 0; d < dim; ++d) {
      EXPECT_NEAR(traction.traction[static_cast<std::size_t>(d)], -5 * turn_of(dim)(d, 0), 1e-12);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Planes, testing::Values(2, 3));

TEST(BoundaryConditions, ExpressionThatIsNotFiniteIsRefusedOnAllRanks) {
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {4, 4, 1}});
  std::vector<BoundaryCondition> conditions(1);
  conditions[0].group = mesh.find_group("x_low");
  conditions[0].kind = ConditionKind::velocity;
  conditions[0].velocity[0] = Expression::parse("1/(y-0.5)");
  EXPECT_THROW(make_constraints(world(), mesh, Geometry::plane, conditions, 0), InputError);
}

TEST(BoundaryConditions, AxisOfRevolutionHasNoRadialVelocity) {
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {3, 3, 1}});
  const NodeConstraints constraints = make_constraints(world(), mesh, Geometry::axisymmetric, {}, 0);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    EXPECT_EQ(constraints.fixed_directions(node), mesh.point(node)[0] < 1e-9 ? 1 : 0);
  }
}

TEST(NodeConstraints, ObliqueDirectionsKeepTheirPrescribedSpeeds) {
  NodeConstraints constraints(3, 1);
  const Eigen::Vector3d first(1, 2, 0);
  const Eigen::Vector3d second(1, 1, 1);
  const Eigen::Vector3d velocity(0.3, -0.4, 2);
  EXPECT_TRUE(constraints.fix_direction(0, first.data(), velocity.data()));
  EXPECT_TRUE(constraints.fix_direction(0, second.data(), velocity.data()));
  EXPECT_FALSE(constraints.fix_direction(0, first.data(), second.data()));
  Eigen::Vector3d v(10, 20, 30);
  constraints.impose(0, v.data());
  EXPECT_NEAR(first.dot(v), first.dot(velocity), 1e-13);
  EXPECT_NEAR(second.dot(v), second.dot(velocity), 1e-13);
  constraints.fix_velocity(0, velocity.data());
  EXPECT_EQ(constraints.fixed_directions(0), 3);
  constraints.impose(0, v.data());
  EXPECT_LT((v - velocity).norm(), 1e-13);
}

}  // namespace
}  // namespace malleus
