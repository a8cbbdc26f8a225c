#include "solvers/soft_pockets.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "solvers/stokes_linear_solver.hpp"
#include "support/stokes_cavity.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

test::CavityOptions soft_spheres(std::vector<test::Sphere> spheres, Real inside) {
  test::CavityOptions options;
  options.box = {.dim = 3, .cells = {12, 12, 12}};
  options.spheres = std::move(spheres);
  options.inside = inside;
  return options;
}

const std::vector<test::Sphere> two_spheres = {{{0.25, 0.3, 0.5}, 0.17}, {{0.7, 0.7, 0.5}, 0.2}};

TEST(SoftPockets, AreCountedAndMeasured) {
  const test::StokesCavity scene(world(), soft_spheres(two_spheres, 1e-4));
  const SoftPockets pockets = find_soft_pockets(scene.system());
  ASSERT_EQ(pockets.count(), 2);
  EXPECT_EQ(pockets.open, 0);
  Real soft = 0;
  for (LocalId element = 0; element < scene.mesh().elements(); ++element) {
    const auto e = static_cast<std::size_t>(element);
    if (scene.system().element_viscosity[e] < 1) soft += scene.system().element_volume[e];
  }
  EXPECT_NEAR(pockets.volume[0] + pockets.volume[1], world().sum(soft), 1e-12);
  for (const Real viscosity : pockets.outside_viscosity) EXPECT_NEAR(viscosity, 1, 1e-12);
}

/// Half a sphere on a wall is closed; on a free side air can leave it.
TEST(SoftPockets, VentedRegionsAreNone) {
  const std::vector<test::Sphere> at_side = {{{0, 0.5, 0.5}, 0.3}};
  test::CavityOptions options = soft_spheres(at_side, 1e-4);
  EXPECT_EQ(find_soft_pockets(test::StokesCavity(world(), options).system()).count(), 1);
  options.is_open = true;
  const SoftPockets vented = find_soft_pockets(test::StokesCavity(world(), options).system());
  EXPECT_EQ(vented.count(), 0);
  EXPECT_EQ(vented.open, 1);
}

TEST(SoftPockets, NoneWithoutContrastOrWhereMostIsSoft) {
  EXPECT_EQ(find_soft_pockets(test::StokesCavity(world(), soft_spheres(two_spheres, 0.1)).system()).count(), 0);
  const SoftPockets stiff = find_soft_pockets(test::StokesCavity(world(), soft_spheres(two_spheres, 1e4)).system());
  EXPECT_EQ(stiff.count(), 0);
  EXPECT_EQ(stiff.open, 1);
}

TEST(SoftPockets, CostFewIterationsAtAnyContrast) {
  LinearVector solution;
  const test::StokesCavity plain(world(), soft_spheres({}, 1));
  const int reference = StokesLinearSolver().solve(plain.system(), plain.right_side(), 1e-6, solution).iterations;
  for (const Real inside : {1e-4, 1e-6, 1e-8}) {
    const test::StokesCavity scene(world(), soft_spheres(two_spheres, inside));
    solution = {};
    const LinearOutcome outcome =
        StokesLinearSolver({.fall_back = false}).solve(scene.system(), scene.right_side(), 1e-6, solution);
    EXPECT_TRUE(outcome.converged);
    EXPECT_LE(outcome.iterations, 1.6 * reference) << "viscosity " << inside;
  }
}

/// Small spheres on a coarse mesh, of which many hang together by a node or an edge.
TEST(SoftPockets, PartsThatTouchByANodeAreDeflatedToo) {
  const Communicator alone(MPI_COMM_SELF);
  for (const Communicator* comm : {&alone, &world()}) {
    LinearVector solution;
    const test::StokesCavity plain(*comm, soft_spheres({}, 1));
    const int reference = StokesLinearSolver().solve(plain.system(), plain.right_side(), 1e-6, solution).iterations;
    const test::StokesCavity scene(*comm, soft_spheres(test::spread_spheres(30, true), 1e-6));
    const SoftPockets pockets = find_soft_pockets(scene.system());
    const std::int32_t last = *std::max_element(pockets.of_node.begin(), pockets.of_node.end());
    EXPECT_GT(pockets.count(), comm->max(GlobalId{last} + 1)) << "there are parts besides the regions";
    solution = {};
    const LinearOutcome outcome =
        StokesLinearSolver({.fall_back = false}).solve(scene.system(), scene.right_side(), 1e-6, solution);
    EXPECT_TRUE(outcome.converged);
    EXPECT_LE(outcome.iterations, 1.5 * reference);
  }
}

}  // namespace
}  // namespace malleus
