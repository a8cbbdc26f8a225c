/// Long thin sections between walls, filled from a gate of given flux: the linear solver must not feel their length.

#include <gtest/gtest.h>

#include <algorithm>

#include "fem/boundary_conditions.hpp"
#include "solvers/stokes_linear_solver.hpp"
#include "support/box_mesh.hpp"
#include "support/stokes_cavity.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

constexpr int across = 4;

struct Strip {
  int dim = 2;
  int slenderness = 10;        ///< length over gap
  Real beyond = 1;             ///< viscosity of the far half
  bool pressure_gate = false;  ///< else a flux with an unknown pressure
  bool closed = false;         ///< the far end is a second gate of given flux: the pressure is free
};

/// Iterations from zero to 1e-6; -1 where it did not converge.
int iterations_through(const Strip& strip) {
  const Real length = strip.slenderness;
  const Mesh mesh = box_mesh(
      world(),
      {.dim = strip.dim, .cells = {across * strip.slenderness, across, across}, .high = {length, 1, 1}, .jitter = 0.1});
  const auto group = [&](const char* name) { return mesh.find_group(name); };
  std::vector<BoundaryCondition> conditions = {{group("y_low"), ConditionKind::no_slip, {}},
                                               {group("y_high"), ConditionKind::no_slip, {}},
                                               {group("x_low"), ConditionKind::no_tangential, {}},
                                               {group("x_high"), ConditionKind::no_tangential, {}}};
  for (const char* name : {"z_low", "z_high"}) {
    if (strip.dim == 3) conditions.push_back({group(name), ConditionKind::symmetry, {}});
  }
  std::vector<Real> viscosity;
  for (LocalId element = 0; element < mesh.elements(); ++element) {
    Real place = 0;
    for (const LocalId node : mesh.nodes_of_element(element)) place += mesh.point(node)[0] / (strip.dim + 1);
    viscosity.push_back(place < 0.5 * length ? 1 : strip.beyond);
  }
  const GivenViscosity model(std::move(viscosity));
  StokesOperator equations(world(), mesh, Geometry::plane);
  equations.set_viscosity(model);
  equations.set_constraints(make_constraints(world(), mesh, Geometry::plane, conditions, 0));
  StokesLoads loads;
  std::vector<FluxGate> gates;
  if (strip.pressure_gate) {
    BoundaryLoad load;
    load.group = group("x_low");
    load.pressure = Expression(1.0);
    loads.tractions = make_tractions(world(), mesh, std::array{load}, 0);
  } else {
    gates.push_back({facets_of_group(mesh, group("x_low")), -1});
  }
  if (strip.closed) gates.push_back({facets_of_group(mesh, group("x_high")), 1});
  equations.set_loads(std::move(loads));
  equations.set_gates(std::move(gates));
  equations.prepare();
  const StokesState state = equations.start_state();
  equations.update_viscosity(state);
  const LinearVector right_side = test::right_side_of(equations, state);
  const LinearSystem& system = equations.tangent(state, Tangent::picard);
  LinearVector solution;
  const LinearOutcome outcome = StokesLinearSolver({.fall_back = false}).solve(system, right_side, 1e-6, solution);
  if (world().is_root())
    std::printf("%dD, length/gap %d: %d iterations\n", strip.dim, strip.slenderness, outcome.iterations);
  return outcome.converged ? outcome.iterations : -1;
}

void expect_few(const Strip& strip, int most) {
  const int iterations = iterations_through(strip);
  EXPECT_GT(iterations, 0);
  EXPECT_LE(iterations, most);
}

// Without the lubrication block: 21 and 76 iterations at 10 and 40 gaps.
TEST(ThinSections, LengthCostsNoIterations) {
  for (const int slenderness : {2, 10, 40}) {
    expect_few({.slenderness = slenderness, .pressure_gate = true}, 25);
    expect_few({.slenderness = slenderness}, 30);
  }
  expect_few({.dim = 3, .slenderness = 20}, 35);
}

TEST(ThinSections, SoftFluidAheadOfTheFront) {
  for (const Real beyond : {1e-2, 1e-4, 1e-6}) {
    expect_few({.slenderness = 20, .beyond = beyond}, 40);
    expect_few({.slenderness = 20, .beyond = beyond, .pressure_gate = true}, 40);
  }
}

TEST(ThinSections, TwoGatesLeaveThePressureFree) {
  expect_few({.slenderness = 30, .closed = true}, 35);
  expect_few({.slenderness = 30, .beyond = 1e-4, .closed = true}, 45);
}

}  // namespace
}  // namespace malleus
