/// Rates of convergence of the Stokes solution against manufactured ones.

#include <gtest/gtest.h>

#include <cmath>

#include "fem/boundary_conditions.hpp"
#include "fem/error_norms.hpp"
#include "solvers/newton.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

/// A flow in the unit box, by formulas; the body force follows from them.
struct Flow {
  int dim;
  std::array<std::string, 3> velocity;
  std::string pressure;
  std::string viscosity;
};

class Formulas {
 public:
  explicit Formulas(const Flow& flow)
      : dim_(flow.dim), pressure(Expression::parse(flow.pressure)), viscosity(Expression::parse(flow.viscosity)) {
    for (std::size_t d = 0; d < static_cast<std::size_t>(dim_); ++d) velocity[d] = Expression::parse(flow.velocity[d]);
  }

  /// - div(2 eta eps(v)) + grad p by central differences.
  Eigen::Vector3d force(const Eigen::Vector3d& x) const {
    constexpr Real h = 1e-3;
    Eigen::Vector3d result = Eigen::Vector3d::Zero();
    for (int j = 0; j < dim_; ++j) {
      const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(j);
      result -= (stress(x + step).col(j) - stress(x - step).col(j)) / (2 * h);
      result[j] += (at(pressure, x + step) - at(pressure, x - step)) / (2 * h);
    }
    return result;
  }
  static Real at(const Expression& formula, const Eigen::Vector3d& x) { return formula({x[0], x[1], x[2]}, 0); }

 private:
  Eigen::Matrix3d stress(const Eigen::Vector3d& x) const {
    constexpr Real h = 1e-3;
    Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
    for (int i = 0; i < dim_; ++i) {
      const Expression& component = velocity[static_cast<std::size_t>(i)];
      for (int j = 0; j < dim_; ++j) {
        const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(j);
        gradient(i, j) = (at(component, x + step) - at(component, x - step)) / (2 * h);
      }
    }
    return at(viscosity, x) * (gradient + gradient.transpose());
  }

  int dim_;

 public:
  std::array<Expression, 3> velocity;
  Expression pressure;
  Expression viscosity;
};

Eigen::Vector3d place_of(const Mesh& mesh, LocalId node) {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  for (int d = 0; d < mesh.dim; ++d) x[d] = mesh.point(node)[d];
  return x;
}

SolutionErrors solve_on(const Flow& flow, int cells) {
  const Mesh mesh = box_mesh(world(), {.dim = flow.dim, .cells = {cells, cells, cells}, .jitter = 0.15});
  const Formulas formulas(flow);
  std::vector<Real> viscosity;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
    for (const LocalId node : mesh.nodes_of_element(e)) centroid += place_of(mesh, node) / (flow.dim + 1);
    viscosity.push_back(Formulas::at(formulas.viscosity, centroid));
  }
  const GivenViscosity model(viscosity);
  StokesLoads loads;
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Eigen::Vector3d force = formulas.force(place_of(mesh, node));
    loads.node_force.insert(loads.node_force.end(), force.data(), force.data() + flow.dim);
  }
  std::vector<BoundaryCondition> conditions;
  for (std::int32_t group = 0; group < static_cast<std::int32_t>(mesh.group_names.size()); ++group) {
    BoundaryCondition& condition = conditions.emplace_back();
    condition.group = group;
    condition.kind = ConditionKind::velocity;
    for (std::size_t d = 0; d < 3; ++d) condition.velocity[d] = formulas.velocity[d];
  }
  StokesOperator op(world(), mesh, Geometry::plane);
  op.set_viscosity(model);
  op.set_constraints(make_constraints(world(), mesh, Geometry::plane, conditions, 0));
  op.set_loads(std::move(loads));
  op.prepare();
  EXPECT_TRUE(op.pressure_is_free());
  StokesState state = op.start_state();
  StokesLinearSolver linear;
  const NewtonOutcome outcome = NewtonSolver({.linear_tolerance = 1e-9}).solve(op, linear, state);
  EXPECT_TRUE(outcome.converged) << outcome.reason;
  EXPECT_EQ(outcome.iterations(), 1);

  std::vector<Real> velocity;
  std::vector<Real> pressure;
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real* values = state.nodes.data() + static_cast<std::size_t>(node) * (flow.dim + 1);
    velocity.insert(velocity.end(), values, values + flow.dim);
    pressure.push_back(values[flow.dim]);
  }
  KnownSolution known;
  for (std::size_t d = 0; d < 3; ++d) known.velocity[d] = formulas.velocity[d];
  known.pressure = formulas.pressure;
  return solution_errors(world(), mesh, Geometry::plane, known,
                         {.velocity = velocity, .pressure = pressure, .level_set = {}, .pressure_is_free = true}, {},
                         0);
}

void expect_rates(const Flow& flow, int coarse, int fine) {
  const SolutionErrors first = solve_on(flow, coarse);
  const SolutionErrors second = solve_on(flow, fine);
  const Real ratio = std::log(static_cast<Real>(fine) / coarse);
  const auto rate = [&](const std::optional<ErrorNorm>& a, const std::optional<ErrorNorm>& b) {
    return std::log(a->absolute / b->absolute) / ratio;
  };
  const Real l2 = rate(first.velocity_l2, second.velocity_l2);
  const Real h1 = rate(first.velocity_h1, second.velocity_h1);
  const Real pressure = rate(first.pressure_l2, second.pressure_l2);
  EXPECT_GE(l2, 1.9);
  EXPECT_GE(h1, 0.95);
  EXPECT_GE(pressure, 1.2);
  if (world().is_root()) {
    std::printf("dim %d: orders %.2f %.2f %.2f; relative errors at %d: %.2e %.2e %.2e\n", flow.dim, l2, h1, pressure,
                fine, second.velocity_l2->relative(), second.velocity_h1->relative(), second.pressure_l2->relative());
  }
}

const std::array<std::string, 3> plane_velocity = {"sin(pi*x)*cos(pi*y)", "-cos(pi*x)*sin(pi*y)", "0"};
const std::array<std::string, 3> space_velocity = {"sin(2*x)*cos(2*y)*cos(2*z)", "cos(2*x)*sin(2*y)*cos(2*z)",
                                                   "-2*cos(2*x)*cos(2*y)*sin(2*z)"};

TEST(ManufacturedStokes, PlaneConstantViscosity) {
  expect_rates({2, plane_velocity, "sin(2*x)*cos(3*y)", "1"}, 16, 32);
}

TEST(ManufacturedStokes, PlaneVariableViscosity) {
  expect_rates({2, plane_velocity, "x*y+sin(3*y)", "exp(3*x-2*y)"}, 16, 32);
}

TEST(ManufacturedStokes, SpaceConstantViscosity) {
  expect_rates({3, space_velocity, "sin(2*x)*cos(3*y)*z", "1"}, 5, 10);
}

TEST(ManufacturedStokes, SpaceVariableViscosity) {
  expect_rates({3, space_velocity, "x*y+sin(3*z)", "exp(x-2*y+z)"}, 5, 10);
}

}  // namespace
}  // namespace malleus
