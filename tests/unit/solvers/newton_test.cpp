#include "solvers/newton.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fem/boundary_conditions.hpp"
#include "support/sticking_block.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

/// These systems are small, and Newton's method is the subject.
LinearSolverOptions direct_solves() {
  LinearSolverOptions options;
  options.method = LinearMethod::direct;
  return options;
}

/// Upsetting of the unit box along `axis`, frictionless: top at speed -1, three planes of symmetry.
NodeConstraints upsetting(const Mesh& mesh, int axis) {
  NodeConstraints constraints(mesh.dim, mesh.nodes());
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    for (int d = 0; d < mesh.dim; ++d) {
      const Real x = mesh.point(node)[d];
      std::array<Real, 3> direction{};
      std::array<Real, 3> velocity{};
      direction[static_cast<std::size_t>(d)] = 1;
      if (x < 1e-9) constraints.fix_direction(node, direction.data(), velocity.data());
      velocity[static_cast<std::size_t>(d)] = -1;
      if (d == axis && x > 1 - 1e-9) constraints.fix_direction(node, direction.data(), velocity.data());
    }
  }
  return constraints;
}

struct Upset {
  NewtonOutcome outcome;
  Real force = 0;
  Real velocity_error = 0;
};

Upset upset(int dim, int axis, Real sensitivity) {
  const Mesh mesh = box_mesh(world(), {.dim = dim, .cells = {4, 5, dim == 3 ? 3 : 1}, .jitter = 0.2});
  std::vector<std::unique_ptr<const ViscousLaw>> laws;
  const Real rate = 1;
  laws.push_back(std::make_unique<NortonHoffLaw>(NortonHoff{2.0, sensitivity, 1e-6 * rate}));
  const RegionViscosity model(std::move(laws));
  StokesOperator op(world(), mesh, Geometry::plane);
  op.set_viscosity(model);
  op.set_constraints(upsetting(mesh, axis));
  op.prepare();
  StokesState state = op.start_state();
  StokesLinearSolver linear(direct_solves());
  Upset result;
  result.outcome =
      NewtonSolver({.tolerance = 1e-8, .linear_tolerance = 1e-10, .start_shear_rate = rate}).solve(op, linear, state);
  const std::vector<Real> reactions = op.reactions(state);
  Real force = 0;
  Real error = 0;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    const Real* v = state.nodes.data() + static_cast<std::size_t>(node) * (dim + 1);
    const Real* x = mesh.point(node);
    if (x[axis] > 1 - 1e-9) force -= reactions[static_cast<std::size_t>(node * dim + axis)];
    for (int d = 0; d < dim; ++d) error = std::max(error, std::abs(v[d] - (d == axis ? -x[d] : x[d] / (dim - 1))));
  }
  result.force = world().sum(force);
  result.velocity_error = world().max(error);
  return result;
}

TEST(Newton, FrictionlessUpsettingIsExact) {
  for (const int dim : {2, 3}) {
    for (int axis = 0; axis < dim; ++axis) {
      for (const Real m : {1.0, 0.5, 0.3, 0.1}) {
        const Upset result = upset(dim, axis, m);
        SCOPED_TRACE(testing::Message() << "dim " << dim << " axis " << axis << " m " << m);
        ASSERT_TRUE(result.outcome.converged) << result.outcome.reason;
        EXPECT_LE(result.outcome.iterations(), m == 1 ? 1 : 15);
        // 3D: sqrt(3) K (sqrt(3) V/H)^m. Plane strain: gamma = 2 V/H, stress = 2 eta (V/H) 2 = 2 K gamma^m.
        const Real exact = dim == 3 ? std::sqrt(3.0) * 2 * std::pow(std::sqrt(3.0), m) : 2 * 2 * std::pow(2.0, m);
        EXPECT_NEAR(result.force / exact, 1, 1e-7);
        EXPECT_LT(result.velocity_error, 1e-7);
      }
    }
  }
}

/// Its cut-off is a hundredth of V/H.
struct Sticking : test::StickingBlock {
  explicit Sticking(Real sensitivity)
      : StickingBlock(world(), {.dim = 2, .cells = {12, 12, 1}, .jitter = 0.15}, sensitivity, 1e-2) {}

  StokesLinearSolver linear{direct_solves()};
};

TEST(Newton, FrictionlessUpsettingOfARevolvedDiscIsExact) {
  for (const Real m : {1.0, 0.3}) {
    const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {5, 4, 1}, .jitter = 0.2});
    std::vector<std::unique_ptr<const ViscousLaw>> laws;
    laws.push_back(std::make_unique<NortonHoffLaw>(NortonHoff{2, m, 1e-6}));
    const RegionViscosity model(std::move(laws));
    std::vector<BoundaryCondition> conditions(2);
    conditions[0] = {mesh.find_group("y_low"), ConditionKind::symmetry, {}};
    conditions[1] = {mesh.find_group("y_high"), ConditionKind::velocity, {std::nullopt, Expression(-1), std::nullopt}};
    StokesOperator op(world(), mesh, Geometry::axisymmetric);
    op.set_viscosity(model);
    op.set_constraints(make_constraints(world(), mesh, Geometry::axisymmetric, conditions, 0));
    op.prepare();
    StokesState state = op.start_state();
    StokesLinearSolver linear(direct_solves());
    const NewtonOutcome outcome =
        NewtonSolver({.tolerance = 1e-8, .linear_tolerance = 1e-10, .start_shear_rate = 1}).solve(op, linear, state);
    ASSERT_TRUE(outcome.converged) << outcome.reason;
    const std::vector<Real> reactions = op.reactions(state);
    Real force = 0;
    for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
      if (mesh.point(node)[1] > 1 - 1e-9) force -= reactions[static_cast<std::size_t>(2 * node + 1)];
    }
    const Real exact = std::numbers::pi * std::sqrt(3.0) * 2 * std::pow(std::sqrt(3.0), m);
    EXPECT_NEAR(world().sum(force) / exact, 1, 1e-7);
  }
}

/// Half of the box is not modelled; in the other half, free to slide on three sides, div v = 0.3 is demanded.
TEST(Newton, VolumeTargetsAndRegionsThatAreNotModelled) {
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {8, 4, 1}});
  std::vector<Real> viscosity;
  StokesLoads loads;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    Real x = 0;
    for (const LocalId node : mesh.nodes_of_element(e)) x += mesh.point(node)[0] / 3;
    viscosity.push_back(x < 0.5 ? 4 : 0);
    loads.element_divergence.push_back(0.3);
  }
  const GivenViscosity model(viscosity);
  std::vector<BoundaryCondition> conditions;
  for (const char* name : {"x_low", "y_low", "y_high"}) {
    conditions.push_back({mesh.find_group(name), ConditionKind::symmetry, {}});
  }
  StokesOperator op(world(), mesh, Geometry::plane);
  op.set_viscosity(model);
  op.set_constraints(make_constraints(world(), mesh, Geometry::plane, conditions, 0));
  op.set_loads(std::move(loads));
  op.prepare();
  EXPECT_FALSE(op.pressure_is_free());  // the cut at x = 0.5 is a free surface
  StokesState state = op.start_state();
  StokesLinearSolver linear(direct_solves());
  const NewtonOutcome outcome = NewtonSolver({.linear_tolerance = 1e-11}).solve(op, linear, state);
  ASSERT_TRUE(outcome.converged) << outcome.reason;
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real x = mesh.point(node)[0];
    const Real* values = state.nodes.data() + static_cast<std::size_t>(node) * 3;
    EXPECT_NEAR(values[0], x < 0.5 + 1e-9 ? 0.3 * x : 0, 1e-9);
    EXPECT_NEAR(values[1], 0, 1e-9);
    // sigma_xx = 2 eta 0.3 - p = 0 at the free surface
    EXPECT_NEAR(values[2], x < 0.5 + 1e-9 ? 2 * 4 * 0.3 : 0, 1e-8);
  }
}

TEST(Newton, ConvergesFromAColdStartAtAnySensitivity) {
  const std::array<std::pair<Real, int>, 5> limits = {{{0.5, 8}, {0.3, 12}, {0.1, 15}, {0.05, 20}, {0.02, 20}}};
  for (const auto& [sensitivity, limit] : limits) {
    Sticking block(sensitivity);
    StokesState state = block.op.start_state();
    const NewtonOutcome outcome =
        NewtonSolver({.tolerance = 1e-6, .start_shear_rate = 1}).solve(block.op, block.linear, state);
    EXPECT_TRUE(outcome.converged) << "m = " << sensitivity << ": " << outcome.reason;
    EXPECT_LE(outcome.iterations(), limit) << "m = " << sensitivity;
    EXPECT_LE(outcome.residual, 1e-6);
    // a good first guess is not thrown away
    const NewtonOutcome again = NewtonSolver({.tolerance = 1e-6}).solve(block.op, block.linear, state);
    EXPECT_EQ(again.iterations(), 0);
  }
}

/// The error of each of the last steps is of the order of the square of that before, also where subscales carry flow.
TEST(Newton, ConvergesQuadratically) {
  for (const Real sensitivity : {0.5, 0.2}) {
    Sticking block(sensitivity);
    StokesState state = block.op.start_state();
    const NewtonOutcome outcome =
        NewtonSolver({.tolerance = 1e-11, .linear_tolerance = 1e-13, .largest_forcing = 1e-8, .start_shear_rate = 1})
            .solve(block.op, block.linear, state);
    ASSERT_TRUE(outcome.converged) << outcome.reason;
    int quadratic = 0;
    for (std::size_t i = 1; i < outcome.history.size(); ++i) {
      const Real before = outcome.history[i - 1].residual;
      const Real after = outcome.history[i].residual;
      if (before > 1e-2 || before < 1e-7) continue;
      EXPECT_LT(after, 30 * before * before) << "m = " << sensitivity << ", iteration " << i;
      ++quadratic;
    }
    EXPECT_GE(quadratic, 1) << "m = " << sensitivity;
  }
}

TEST(Newton, AnUnconvergedSolveSaysSoAndWhere) {
  Sticking block(0.1);
  StokesState state = block.op.start_state();
  const NewtonOutcome outcome = NewtonSolver({.tolerance = 1e-6, .max_iterations = 4, .start_shear_rate = 1})
                                    .solve(block.op, block.linear, state);
  EXPECT_FALSE(outcome.converged);
  EXPECT_EQ(outcome.iterations(), 4);
  EXPECT_GT(outcome.residual, 1e-6);
  EXPECT_NE(outcome.reason.find("no convergence"), std::string::npos);
  EXPECT_GT(outcome.worst.force, 0);
}

TEST(Newton, PowerOfThePlatensIsThatDissipated) {
  Sticking block(0.3);
  StokesState state = block.op.start_state();
  const NewtonOutcome outcome =
      NewtonSolver({.tolerance = 1e-8, .start_shear_rate = 1}).solve(block.op, block.linear, state);
  ASSERT_TRUE(outcome.converged) << outcome.reason;
  const std::vector<Real> reactions = block.op.reactions(state);
  Real top = 0;
  Real all = 0;
  for (LocalId node = 0; node < block.mesh.owned_nodes(); ++node) {
    const Real force = reactions[static_cast<std::size_t>(2 * node + 1)];
    all += force;
    if (block.mesh.point(node)[1] > 1 - 1e-9) top += force;
  }
  EXPECT_NEAR(world().sum(all), 0, 1e-6);  // the platens' forces balance
  // velocities of 1 at the top: the force is the power; the bubble's part of the dissipation is the pressure's p C p
  EXPECT_NEAR(-world().sum(top) / block.op.dissipation(state), 1, 1e-6);
}

}  // namespace
}  // namespace malleus
