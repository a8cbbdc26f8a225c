/// The heat equation against closed forms, on any number of ranks.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fem/heat_element.hpp"
#include "solvers/heat_equation.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

HeatScene uniform_scene(const Mesh& mesh, Real capacity, Real conductivity) {
  HeatScene scene;
  scene.capacity.assign(static_cast<std::size_t>(mesh.elements()), capacity);
  scene.conductivity.assign(static_cast<std::size_t>(mesh.elements()), conductivity);
  return scene;
}

template <class Function>
std::vector<Real> at_nodes(const Mesh& mesh, Function value) {
  std::vector<Real> values;
  for (LocalId node = 0; node < mesh.nodes(); ++node) values.push_back(value(mesh.point(node)));
  return values;
}

/// What each rank's own facets of a group give their nodes.
std::vector<Real> areas(const Mesh& mesh, const std::string& group, Geometry geometry = Geometry::plane) {
  std::vector<Real> sums(static_cast<std::size_t>(mesh.nodes()), 0.0);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId f = 0; f < mesh.exterior_facets; ++f) {
      if (mesh.facet_group[static_cast<std::size_t>(f)] != mesh.find_group(group)) continue;
      const auto shares = facet_integrals<D>(mesh, f, geometry).shares();
      for (int i = 0; i < D; ++i)
        sums[static_cast<std::size_t>(mesh.nodes_of_facet(f)[static_cast<std::size_t>(i)])] += shares[i];
    }
  });
  return sums;
}

void fix_group(const Mesh& mesh, const std::string& group, Real value, HeatScene& scene) {
  std::vector<Real> marks = areas(mesh, group);
  mesh.node_halo.max_to_owners(marks, 1);
  mesh.node_halo.update_copies(std::span(marks), 1);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (!(marks[static_cast<std::size_t>(node)] > 0)) continue;
    scene.fixed.push_back(node);
    scene.fixed_values.push_back(value);
  }
}

Real largest_error(const Mesh& mesh, const std::vector<Real>& found, const std::vector<Real>& expected) {
  Real worst = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(mesh.nodes()); ++i)
    worst = std::max(worst, std::abs(found[i] - expected[i]));
  return world().max(worst);
}

/// exp(-k pi^2 t / rho c) cos(pi x), insulated: the error at the end.
Real decay_error(int dim, int cells, int steps) {
  const Mesh mesh = box_mesh(world(), {.dim = dim, .cells = {cells, cells, cells}, .jitter = 0.1});
  const Real time = 0.05;
  std::vector<Real> temperature = at_nodes(mesh, [](const Real* x) { return 2 + std::cos(std::numbers::pi * x[0]); });
  HeatEquation heat(world(), mesh, Geometry::plane);
  const HeatScene scene = uniform_scene(mesh, 3, 6);
  for (int i = 0; i < steps; ++i) EXPECT_TRUE(heat.advance(scene, time / steps, temperature).converged);
  const Real decay = std::exp(-2 * std::numbers::pi * std::numbers::pi * time);
  return largest_error(mesh, temperature,
                       at_nodes(mesh, [&](const Real* x) { return 2 + decay * std::cos(std::numbers::pi * x[0]); }));
}

TEST(HeatEquation, ConvergesWithMeshAndStep) {
  for (const int dim : {2, 3}) {
    const Real coarse = decay_error(dim, 4, 4);
    const Real fine = decay_error(dim, 8, 16);
    EXPECT_LT(fine, coarse / 2.5) << dim;
    EXPECT_LT(fine, 0.05) << dim;
  }
  const Real long_steps = decay_error(2, 16, 5);
  const Real short_steps = decay_error(2, 16, 10);
  EXPECT_NEAR(long_steps / short_steps, 2, 0.3);
}

TEST(HeatEquation, IsSteadyBetweenTwoTemperaturesAndPassesOnWhatItTakes) {
  const Mesh mesh = box_mesh(world(), {.dim = 3, .cells = {5, 3, 4}, .jitter = 0.2});
  HeatScene scene = uniform_scene(mesh, 2, 7);
  fix_group(mesh, "x_low", 300, scene);
  fix_group(mesh, "x_high", 400, scene);
  std::vector<Real> temperature = at_nodes(mesh, [](const Real*) { return 350.0; });
  HeatEquation heat(world(), mesh, Geometry::plane);
  for (int i = 0; i < 3; ++i) heat.advance(scene, 1e4, temperature);
  EXPECT_LT(largest_error(mesh, temperature, at_nodes(mesh, [](const Real* x) { return 300 + 100 * x[0]; })), 1e-4);
  scene.fixed.clear();
  scene.fixed_values.clear();
  fix_group(mesh, "x_low", 300, scene);
  scene.node_source = areas(mesh, "x_high");
  for (Real& heat_flow : scene.node_source) heat_flow *= 700;
  HeatReport report;
  for (int i = 0; i < 3; ++i) report = heat.advance(scene, 1e4, temperature);
  EXPECT_NEAR(report.supplied, 7e6, 1e-3);
  EXPECT_NEAR(report.imposed, -7e6, 1);
}

TEST(HeatEquation, CoolsAsOneBlockWhereConductionIsFast) {
  // rho c V dT/dt = -h A (T - T0): backward Euler's map is exact for a body of one temperature.
  for (const int dim : {2, 3}) {
    const Mesh mesh = box_mesh(world(), {.dim = dim, .cells = {3, 3, 3}});
    HeatScene scene = uniform_scene(mesh, 1e3, 1e9);
    scene.conductance = areas(mesh, "y_high");
    for (Real& h : scene.conductance) h *= 50;
    scene.surroundings = scene.conductance;
    for (Real& s : scene.surroundings) s *= 290;
    std::vector<Real> temperature = at_nodes(mesh, [](const Real*) { return 1290.0; });
    HeatEquation heat(world(), mesh, Geometry::plane);
    Real lost = 0;
    for (int i = 0; i < 20; ++i) lost += heat.advance(scene, 2, temperature).lost;
    const Real expected = 290 + 1000 / std::pow(1 + 50 * 2 / 1e3, 20);
    EXPECT_LT(largest_error(mesh, temperature, at_nodes(mesh, [&](const Real*) { return expected; })), 1e-3);
    EXPECT_NEAR(lost / (1e3 * (1290 - expected)), 1, 1e-6);
  }
}

TEST(HeatEquation, RadiatesByTheFourthPower) {
  // rho c V dT/dt = -s A T^4 to cold space: 1/T^3 grows by 3 s A t / (rho c V).
  const Mesh mesh = box_mesh(world(), {.dim = 3, .cells = {2, 2, 2}});
  HeatScene scene = uniform_scene(mesh, 4e6, 1e9);
  scene.emission = areas(mesh, "z_high");
  for (Real& s : scene.emission) s *= 5.670374419e-8;
  std::vector<Real> temperature = at_nodes(mesh, [](const Real*) { return 1500.0; });
  HeatEquation heat(world(), mesh, Geometry::plane);
  const int steps = 40;
  const Real time = 4e3;
  for (int i = 0; i < steps; ++i) EXPECT_TRUE(heat.advance(scene, time / steps, temperature).converged);
  const Real expected = std::pow(std::pow(1500.0, -3) + 3 * 5.670374419e-8 * time / 4e6, -1.0 / 3);
  EXPECT_LT(largest_error(mesh, temperature, at_nodes(mesh, [&](const Real*) { return expected; })),
            0.02 * (1500 - expected));
}

TEST(HeatEquation, KeepsWithinItsRangeAtAShock) {
  // The layer of the first steps is a tenth of an element thick: a consistent mass matrix undershoots.
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {12, 4, 1}});
  HeatScene scene = uniform_scene(mesh, 1, 1);
  fix_group(mesh, "x_low", 1000, scene);
  std::vector<Real> temperature = at_nodes(mesh, [](const Real*) { return 300.0; });
  HeatEquation heat(world(), mesh, Geometry::plane);
  for (int i = 0; i < 4; ++i) {
    heat.advance(scene, 1e-5, temperature);
    for (const Real t : temperature) {
      EXPECT_GE(t, 300 - 1e-6);
      EXPECT_LE(t, 1000 + 1e-6);
    }
  }
}

TEST(HeatEquation, CarriesHeatOverBridges) {
  // Every node of one end is tied to the middle of a face of the other: both ends meet, and no heat is lost.
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {6, 2, 1}});
  HeatScene scene = uniform_scene(mesh, 5, 1e-9);
  const Real total = world().sum(static_cast<Real>(mesh.elements()));
  ASSERT_GT(total, 0);
  // Each rank ties its owned nodes to global nodes 0, 1 and 2, wherever they are.
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    const GlobalId number = mesh.global_node(node);
    if (number > 2) scene.bridges.push_back({number, 1e3, {0, 1, 2}, {0.2, 0.3, 0.5}});
  }
  std::vector<Real> temperature = at_nodes(mesh, [](const Real* x) { return 300 + 100 * x[0]; });
  HeatEquation heat(world(), mesh, Geometry::plane);
  HeatReport report;
  for (int i = 0; i < 4; ++i) report = heat.advance(scene, 1e3, temperature);
  EXPECT_NEAR(report.stored, 0, 1e-6);
  EXPECT_NEAR(report.lost, 0, 1e-12);
  Real low = 1e300, high = 0;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    if (mesh.global_node(node) <= 2) continue;
    low = std::min(low, temperature[static_cast<std::size_t>(node)]);
    high = std::max(high, temperature[static_cast<std::size_t>(node)]);
  }
  EXPECT_NEAR(world().max(high), world().min(low), 1e-3);
}

TEST(HeatEquation, WeighsWithTheRadiusWhereTheSceneIsRevolved) {
  // A ring between two radii, steady: T goes with the logarithm of r; the heat is 2 pi k H dT / ln(r1/r0).
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {24, 2, 1}, .low = {1, 0, 0}, .high = {3, 1, 1}});
  HeatScene scene = uniform_scene(mesh, 1, 2);
  fix_group(mesh, "x_low", 500, scene);
  fix_group(mesh, "x_high", 300, scene);
  std::vector<Real> temperature = at_nodes(mesh, [](const Real*) { return 300.0; });
  HeatEquation heat(world(), mesh, Geometry::axisymmetric);
  for (int i = 0; i < 4; ++i) heat.advance(scene, 1e4, temperature);
  const auto expected = at_nodes(mesh, [](const Real* x) { return 500 - 200 * std::log(x[0]) / std::log(3.0); });
  EXPECT_LT(largest_error(mesh, temperature, expected), 0.2);
  HeatScene cooled = uniform_scene(mesh, 1, 2);
  cooled.element_source.assign(static_cast<std::size_t>(mesh.elements()), 10);
  const HeatReport report = heat.advance(cooled, 2, temperature);
  EXPECT_NEAR(report.supplied, 20 * std::numbers::pi * (9 - 1), 1e-9);
  EXPECT_NEAR(report.stored, report.supplied, 1e-6);
}

}  // namespace
}  // namespace malleus
