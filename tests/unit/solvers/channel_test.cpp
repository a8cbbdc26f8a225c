/// Pressure-driven flow through slits and tubes, with gates whose pressure is an unknown.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fem/boundary_conditions.hpp"
#include "solvers/newton.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

constexpr Real length = 2;
constexpr Real flow = 0.7;
constexpr Real consistency = 3;

struct Passage {
  bool tube = false;  ///< radius 1 along y, else a slit of height 1 along x
  int across = 8;     ///< elements across the height, or the radius
  Real exponent = 1;
  bool second_gate = false;  ///< the far end has a demanded flow, too: the pressure is free
};

struct Answer {
  NewtonOutcome outcome;
  Real drop = 0;     ///< Pa
  Real outflow = 0;  ///< through the far end, m^3/s
  bool pressure_is_free = false;
};

Answer flow_through(const Passage& passage) {
  const int along = 2 * passage.across;
  const Mesh mesh =
      box_mesh(world(), {.dim = 2,
                         .cells = {passage.tube ? passage.across : along, passage.tube ? along : passage.across, 1},
                         .high = {passage.tube ? 1 : length, passage.tube ? length : 1, 1}});
  const Geometry geometry = passage.tube ? Geometry::axisymmetric : Geometry::plane;
  const std::int32_t inlet = mesh.find_group(passage.tube ? "y_low" : "x_low");
  const std::int32_t outlet = mesh.find_group(passage.tube ? "y_high" : "x_high");
  std::vector<BoundaryCondition> conditions = {
      {mesh.find_group(passage.tube ? "x_high" : "y_high"), ConditionKind::no_slip, {}},
      {inlet, ConditionKind::no_tangential, {}},
      {outlet, ConditionKind::no_tangential, {}}};
  if (!passage.tube) conditions.push_back({mesh.find_group("y_low"), ConditionKind::no_slip, {}});
  std::vector<std::unique_ptr<const ViscousLaw>> laws;
  laws.push_back(std::make_unique<NortonHoffLaw>(NortonHoff{consistency, passage.exponent, 1e-4}));
  const RegionViscosity model(std::move(laws));
  StokesOperator op(world(), mesh, geometry);
  op.set_viscosity(model);
  op.set_constraints(make_constraints(world(), mesh, geometry, conditions, 0));
  std::vector<FluxGate> gates = {{facets_of_group(mesh, inlet), -flow}};
  if (passage.second_gate) gates.push_back({facets_of_group(mesh, outlet), flow});
  op.set_gates(std::move(gates));
  op.prepare();
  StokesState state = op.start_state();
  LinearSolverOptions direct;
  direct.method = LinearMethod::direct;
  StokesLinearSolver linear(direct);
  Answer answer;
  answer.outcome =
      NewtonSolver({.tolerance = 1e-8, .linear_tolerance = 1e-9, .start_shear_rate = 1}).solve(op, linear, state);
  answer.drop = state.borders[0] - (passage.second_gate ? state.borders[1] : 0);
  answer.outflow = boundary_flux(world(), mesh, geometry, facets_of_group(mesh, outlet), state.nodes, 3);
  answer.pressure_is_free = op.pressure_is_free();
  return answer;
}

/// Pressure drops of the power law (Bird, Armstrong, Hassager 1987, ch. 4).
Real exact_drop(const Passage& passage) {
  const Real n = passage.exponent;
  const Real slit_rate = 6 * flow * (2 * n + 1) / (3 * n);
  const Real tube_rate = 4 * flow / std::numbers::pi * (3 * n + 1) / (4 * n);
  return 2 * length * consistency * std::pow(passage.tube ? tube_rate : slit_rate, n);
}

void expect_drop(const Passage& passage, Real tolerance) {
  const Answer answer = flow_through(passage);
  ASSERT_TRUE(answer.outcome.converged) << answer.outcome.reason;
  EXPECT_NEAR(answer.drop / exact_drop(passage), 1, tolerance);
  EXPECT_NEAR(answer.outflow, flow, 1e-7 * flow);
  EXPECT_EQ(answer.pressure_is_free, passage.second_gate);
  if (world().is_root()) {
    std::printf("%s n = %g, %d across: drop %+.2f %%, %d iterations\n", passage.tube ? "tube" : "slit",
                passage.exponent, passage.across, 100 * (answer.drop / exact_drop(passage) - 1),
                answer.outcome.iterations());
  }
}

TEST(Channel, SlitDropFallsWithElementsAcross) {
  // A P1 profile with n equal rows carries 1 - 1/n^2 of the parabola's flow at the same gradient.
  for (const int across : {2, 3, 4, 6, 8}) expect_drop({.across = across}, 1.0 / (across * across - 1));
}

TEST(Channel, SlitOfAPowerLaw) {
  expect_drop({.across = 8, .exponent = 0.4}, 0.02);
}

TEST(Channel, TwoGatesLeaveThePressureFree) {
  expect_drop({.across = 6, .second_gate = true}, 1.0 / 35);
}

TEST(Channel, TubeRevolved) {
  expect_drop({.tube = true, .across = 8}, 0.03);
  expect_drop({.tube = true, .across = 8, .exponent = 0.5}, 0.03);
}

}  // namespace
}  // namespace malleus
