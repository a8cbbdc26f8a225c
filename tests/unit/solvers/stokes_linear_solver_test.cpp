#include "solvers/stokes_linear_solver.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/floating_point.hpp"
#include "solvers/bordered_operator.hpp"
#include "support/stokes_cavity.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::CavityOptions;
using test::StokesCavity;
using test::world;

CavityOptions cavity(int dim, int cells) {
  CavityOptions options;
  options.box = {.dim = dim, .cells = {cells, cells, cells}, .jitter = 0.2};
  return options;
}

/// ||b - K x|| / ||b|| from the matrix, without the null space's part of b.
Real true_residual(const LinearSystem& system, const LinearVector& right_side, const LinearVector& solution) {
  const BorderedOperator op(system);
  const PetscVector b = op.make_vector();
  const PetscVector x = op.make_vector();
  const PetscVector r = op.make_vector();
  op.fill(right_side, b.get());
  op.fill(solution, x.get());
  PetscReal size = 0;
  PetscReal rest = 0;
  VecNorm(b.get(), NORM_2, &size);
  if (op.null_space() != nullptr) MatNullSpaceRemove(op.null_space(), b.get());
  MatMult(op.matrix(), x.get(), r.get());
  VecAYPX(r.get(), -1.0, b.get());
  VecNorm(r.get(), NORM_2, &rest);
  return rest / size;
}

Real norm(const Communicator& comm, const std::vector<Real>& values) {
  Real square = 0;
  for (const Real value : values) square += value * value;
  return std::sqrt(comm.sum(square));
}

Real relative_difference(const LinearVector& a, const LinearVector& b) {
  std::vector<Real> difference(a.nodes.size());
  for (std::size_t i = 0; i < difference.size(); ++i) difference[i] = a.nodes[i] - b.nodes[i];
  return norm(world(), difference) / norm(world(), b.nodes);
}

LinearOutcome solve(const StokesCavity& scene, const LinearSolverOptions& options, Real tolerance,
                    LinearVector& solution) {
  solution = {};
  return StokesLinearSolver(options).solve(scene.system(), scene.right_side(), tolerance, solution);
}

int iterations(const Communicator& comm, const CavityOptions& options) {
  const StokesCavity scene(comm, options);
  LinearVector solution;
  const LinearOutcome outcome =
      StokesLinearSolver({.fall_back = false}).solve(scene.system(), scene.right_side(), 1e-6, solution);
  EXPECT_TRUE(outcome.converged) << outcome.reason;
  EXPECT_LE(true_residual(scene.system(), scene.right_side(), solution), 1.000001e-6);
  return outcome.iterations;
}

TEST(StokesLinearSolver, CavityTakesFewIterationsAtAnySize) {
  EXPECT_LE(iterations(world(), cavity(2, 12)), 28);
  EXPECT_LE(iterations(world(), cavity(2, 40)), 32);
  EXPECT_LE(iterations(world(), cavity(3, 6)), 42);
  EXPECT_LE(iterations(world(), cavity(3, 12)), 42);
}

TEST(StokesLinearSolver, RanksDoNotCostIterations) {
  const Communicator alone(MPI_COMM_SELF);
  for (const int dim : {2, 3}) {
    const CavityOptions options = cavity(dim, dim == 2 ? 24 : 8);
    EXPECT_LE(iterations(world(), options), 1.3 * iterations(alone, options));
  }
}

TEST(StokesLinearSolver, MoreRanksThanElementsWork) {
  CavityOptions options = cavity(2, 1);
  options.is_open = true;
  options.box.cells = {1, 2, 1};
  EXPECT_LE(iterations(world(), options), 20);
}

TEST(StokesLinearSolver, StiffInclusionsCostLittle) {
  CavityOptions options = cavity(3, 14);
  options.spheres = {{{0.3, 0.5, 0.5}, 0.2}, {{0.75, 0.5, 0.4}, 0.18}};
  const int plain = iterations(world(), options);
  for (const Real contrast : {1e2, 1e4, 1e8}) {
    options.inside = contrast;
    EXPECT_LE(iterations(world(), options), 1.6 * plain) << "contrast " << contrast;
  }
}

TEST(StokesLinearSolver, UnitsOfViscosityDoNotMatter) {
  CavityOptions options = cavity(3, 6);
  const int plain = iterations(world(), options);
  for (const Real scale : {1e-9, 1e9}) {
    options.viscosity_scale = scale;
    EXPECT_NEAR(iterations(world(), options), plain, 1) << "scale " << scale;
  }
}

Real tolerance_of(LinearMethod method) {
  return method == LinearMethod::conjugate_residual ? 1e-6 : 1e-9;
}

TEST(StokesLinearSolver, MethodsAgree) {
  CavityOptions options = cavity(3, 5);
  options.spheres = test::spread_spheres(3, false);
  options.inside = 20;
  const StokesCavity scene(world(), options);
  LinearVector exact;
  LinearVector solution;
  ASSERT_TRUE(solve(scene, {.method = LinearMethod::direct}, 1e-12, exact).converged);
  for (const LinearMethod method : {LinearMethod::block_triangular, LinearMethod::gamg, LinearMethod::gmres_ilu,
                                    LinearMethod::conjugate_residual}) {
    const Real tolerance = tolerance_of(method);
    const LinearOutcome outcome = solve(scene, {.method = method, .fall_back = false}, tolerance, solution);
    EXPECT_TRUE(outcome.converged) << outcome.reason;
    EXPECT_LT(relative_difference(solution, exact), 1e3 * tolerance) << "method " << static_cast<int>(method);
    EXPECT_LE(true_residual(scene.system(), scene.right_side(), solution), 1.000001 * tolerance);
  }
}

TEST(StokesLinearSolver, NothingToSolveGivesZero) {
  const StokesCavity scene(world(), cavity(2, 4));
  LinearVector zero = scene.right_side();
  for (Real& value : zero.nodes) value = 0;
  LinearVector solution;
  const LinearOutcome outcome = StokesLinearSolver().solve(scene.system(), zero, 1e-6, solution);
  EXPECT_TRUE(outcome.converged);
  EXPECT_EQ(outcome.iterations, 0);
  EXPECT_EQ(norm(world(), solution.nodes), 0);
}

TEST(StokesLinearSolver, FailureIsToldAndAnswered) {
  const StokesCavity scene(world(), cavity(2, 10));
  LinearVector solution;
  LinearSolverOptions options{.max_iterations = 3, .fall_back = false};
  const LinearOutcome failed = solve(scene, options, 1e-6, solution);
  EXPECT_FALSE(failed.converged);
  EXPECT_FALSE(failed.reason.empty());
  EXPECT_GT(failed.residual, 1e-6);
  EXPECT_NEAR(failed.residual, true_residual(scene.system(), scene.right_side(), solution), 1e-12);
  options.fall_back = true;
  const LinearOutcome saved = solve(scene, options, 1e-6, solution);
  EXPECT_TRUE(saved.converged);
  EXPECT_EQ(saved.fallbacks, 4) << "rigid modes, double precision, GAMG, direct";
  EXPECT_LE(true_residual(scene.system(), scene.right_side(), solution), 1.000001e-6);
}

/// Translations are given fewer iterations than they need, and what rotations need.
TEST(StokesLinearSolver, KeepsToTheStepThatSolvedTheLastSystem) {
  CavityOptions options = cavity(3, 8);
  options.spheres = test::spread_spheres(4, false);
  options.inside = 1e4;
  const StokesCavity scene(world(), options);
  LinearSolverOptions weak;
  weak.preconditioner.modes = CoarseModes::translations;
  LinearVector solution;
  weak.max_iterations = 400;
  weak.fall_back = false;
  const int with_translations = solve(scene, weak, 1e-6, solution).iterations;
  weak.preconditioner.modes = CoarseModes::rigid;
  const int with_rotations = solve(scene, weak, 1e-6, solution).iterations;
  ASSERT_LT(with_rotations + 2, with_translations) << "else this scene shows nothing";
  weak.preconditioner.modes = CoarseModes::translations;
  weak.fall_back = true;
  weak.max_iterations = with_rotations + 2;
  StokesLinearSolver solver(weak);
  solution = {};
  const LinearOutcome first = solver.solve(scene.system(), scene.right_side(), 1e-6, solution);
  EXPECT_TRUE(first.converged);
  EXPECT_EQ(first.fallbacks, 1) << "rigid-body modes";
  EXPECT_GT(first.iterations, weak.max_iterations) << "those of both steps count";
  solution = {};
  const LinearOutcome second = solver.solve(scene.system(), scene.right_side(), 1e-6, solution);
  EXPECT_TRUE(second.converged);
  EXPECT_EQ(second.fallbacks, 0);
  EXPECT_FALSE(second.setup_built);
}

/// What is not a number never comes back as a solution, and ends the chain.
TEST(StokesLinearSolver, NotANumberIsTold) {
  const StokesCavity scene(world(), cavity(2, 6));
  const TrapsOff traps_off;
  LinearVector poisoned = scene.right_side();
  for (Real& value : poisoned.nodes) value = std::numeric_limits<Real>::quiet_NaN();
  LinearVector solution;
  ASSERT_TRUE(solve(scene, {}, 1e-6, solution).converged);
  const LinearOutcome outcome = StokesLinearSolver().solve(scene.system(), poisoned, 1e-6, solution);
  EXPECT_FALSE(outcome.converged);
  EXPECT_EQ(outcome.iterations, 0);
  EXPECT_FALSE(outcome.reason.empty());
  EXPECT_TRUE(solution.nodes.empty());
}

/// Entries of the matrix that are no numbers break every step of the chain down.
TEST(StokesLinearSolver, BreakdownIsTold) {
  const StokesCavity scene(world(), cavity(2, 6));
  const TrapsOff traps_off;
  MatScale(scene.system().matrix, std::numeric_limits<Real>::quiet_NaN());
  LinearVector solution;
  const LinearOutcome outcome = solve(scene, {}, 1e-6, solution);
  EXPECT_FALSE(outcome.converged);
  EXPECT_FALSE(outcome.reason.empty());
  for (const Real value : solution.nodes) EXPECT_TRUE(std::isfinite(value));
}

/// 1e-18 is beyond what double precision holds: each step stagnates, and what is told is the residual that was reached.
TEST(StokesLinearSolver, StagnationIsTold) {
  const StokesCavity scene(world(), cavity(2, 10));
  LinearVector solution;
  const LinearOutcome outcome = solve(scene, {}, 1e-18, solution);
  EXPECT_FALSE(outcome.converged);
  EXPECT_FALSE(outcome.reason.empty());
  EXPECT_LT(outcome.residual, 1e-9);
  EXPECT_NEAR(outcome.residual, true_residual(scene.system(), scene.right_side(), solution), 1e-15);
}

/// A block a million times as stiff, deformable, pressed on a softer one: as a die on a workpiece.
TEST(StokesLinearSolver, NearlyRigidBodiesCostLittle) {
  CavityOptions options = cavity(3, 12);
  options.is_open = true;
  const int plain = iterations(world(), options);
  options.spheres = {{{0.5, 0.5, 1.3}, 0.7}};  // the upper part, with the top that moves
  options.inside = 4.6e6;
  EXPECT_LE(iterations(world(), options), 1.6 * plain);
}

TEST(StokesLinearSolver, MatrixFreeSystemsAreSolvedAlike) {
  CavityOptions options = cavity(3, 8);
  options.spheres = test::spread_spheres(4, false);
  options.inside = 1e3;
  const StokesCavity assembled(world(), options);
  options.matrix_free = true;
  const StokesCavity scene(world(), options);
  ASSERT_NE(scene.system().entries, nullptr);
  LinearVector expected;
  LinearVector solution;
  const LinearOutcome reference = solve(assembled, {}, 1e-8, expected);
  for (const LinearMethod method : {LinearMethod::block_triangular, LinearMethod::gamg, LinearMethod::direct}) {
    const LinearOutcome outcome = solve(scene, {.method = method, .fall_back = false}, 1e-8, solution);
    EXPECT_TRUE(outcome.converged) << outcome.reason;
    EXPECT_LT(relative_difference(solution, expected), 1e-5);
    if (method == LinearMethod::block_triangular) {
      EXPECT_NEAR(outcome.iterations, reference.iterations, 1);
    }
  }
}

TEST(StokesLinearSolver, SameInputGivesTheSameBits) {
  const StokesCavity scene(world(), cavity(3, 6));
  LinearVector first;
  LinearVector second;
  solve(scene, {}, 1e-6, first);
  solve(scene, {}, 1e-6, second);
  EXPECT_EQ(first.nodes, second.nodes);
}

TEST(StokesLinearSolver, HierarchyIsKeptUntilItAges) {
  const StokesCavity scene(world(), cavity(3, 6));
  LinearSystem system = scene.system();
  StokesLinearSolver solver;
  LinearVector solution;
  EXPECT_TRUE(solver.solve(system, scene.right_side(), 1e-6, solution).setup_built);
  solution = {};
  EXPECT_FALSE(solver.solve(system, scene.right_side(), 1e-6, solution).setup_built);
  CavityOptions other = cavity(3, 6);
  other.spheres = test::spread_spheres(8, false);
  other.inside = 25;
  const StokesCavity changed(world(), other);
  LinearSystem next = changed.system();
  next.pattern_version = system.pattern_version;
  next.value_version = system.value_version + 1;
  solution = {};
  const LinearOutcome aged = solver.solve(next, changed.right_side(), 1e-6, solution);
  EXPECT_TRUE(aged.converged);
  EXPECT_TRUE(aged.setup_built);  // within the solve, once the old one has had its time
  solution = {};
  const LinearOutcome renewed = solver.solve(next, changed.right_side(), 1e-6, solution);
  EXPECT_FALSE(renewed.setup_built);
  EXPECT_LT(renewed.iterations, aged.iterations);
  next.pattern_version += 1;
  solution = {};
  EXPECT_TRUE(solver.solve(next, changed.right_side(), 1e-6, solution).setup_built);
}

TEST(StokesLinearSolver, WarmStartSavesIterations) {
  const StokesCavity scene(world(), cavity(3, 6));
  StokesLinearSolver solver;
  LinearVector solution;
  const int cold = solver.solve(scene.system(), scene.right_side(), 1e-6, solution).iterations;
  EXPECT_EQ(solver.solve(scene.system(), scene.right_side(), 1e-6, solution).iterations, 0);
  EXPECT_LT(solver.solve(scene.system(), scene.right_side(), 1e-8, solution).iterations, cold);
}

/// A channel with a gate of given flux on x = 0, open at x = 1: the pressure of the gate is an unknown of the border.
TEST(StokesLinearSolver, GatesOfUnknownPressureCostNothing) {
  const Mesh mesh = test::box_mesh(world(), {.dim = 3, .cells = {8, 6, 6}, .jitter = 0.1});
  NodeConstraints walls(3, mesh.nodes());
  constexpr std::array<Real, 3> rest{};
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real* x = mesh.point(node);
    if (std::min({x[1], x[2], 1 - x[1], 1 - x[2]}) < 1e-9) walls.fix_velocity(node, rest.data());
  }
  FluxGate gate{.facets = {}, .flux = -2};
  for (LocalId facet = 0; facet < mesh.exterior_facets; ++facet) {
    if (mesh.facet_group[static_cast<std::size_t>(facet)] == mesh.find_group("x_low")) gate.facets.push_back(facet);
  }
  const GivenViscosity model(std::vector<Real>(static_cast<std::size_t>(mesh.elements()), 3.0));
  StokesOperator equations(world(), mesh, Geometry::plane);
  equations.set_viscosity(model);
  equations.set_constraints(walls);
  equations.set_gates({gate});
  equations.prepare();
  StokesState state = equations.start_state();
  equations.update_viscosity(state);
  const LinearVector right_side = test::right_side_of(equations, state);
  const LinearSystem& system = equations.tangent(state, Tangent::picard);
  LinearVector exact;
  ASSERT_TRUE(StokesLinearSolver({.method = LinearMethod::direct}).solve(system, right_side, 1e-12, exact).converged);
  for (const LinearMethod method : {LinearMethod::block_triangular, LinearMethod::conjugate_residual}) {
    LinearVector solution;
    const LinearOutcome outcome = StokesLinearSolver({.method = method, .fall_back = false})
                                      .solve(system, right_side, tolerance_of(method), solution);
    EXPECT_TRUE(outcome.converged) << outcome.reason;
    EXPECT_LE(outcome.iterations, method == LinearMethod::block_triangular ? 60 : 200);
    EXPECT_LT(relative_difference(solution, exact), 1e3 * tolerance_of(method));
    ASSERT_EQ(solution.borders.size(), 1U);
    EXPECT_GT(std::abs(exact.borders[0]), 0);
    EXPECT_NEAR(solution.borders[0] / exact.borders[0], 1, 1e3 * tolerance_of(method));
  }
}

}  // namespace
}  // namespace malleus
