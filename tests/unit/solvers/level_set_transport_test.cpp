#include "solvers/level_set_transport.hpp"

#include <gtest/gtest.h>

#include "level_set_cases.hpp"

namespace malleus {
namespace {

using test::at_nodes;
using test::world;

Mesh unit_mesh(int dim, int cells) {
  return test::box_mesh(world(), {dim, {cells, cells, cells}, {0, 0, 0}, {1, 1, 1}, 0.2});
}

Real largest_difference(const Mesh& mesh, const std::vector<Real>& a, const std::vector<Real>& b) {
  Real difference = 0;
  for (std::size_t n = 0; n < static_cast<std::size_t>(mesh.nodes()); ++n) {
    difference = std::max(difference, std::abs(a[n] - b[n]));
  }
  return world().max(difference);
}

/// Nodes on the plane x = 0, where the level set is imposed.
ImposedLevelSet imposed_at_entry(const Mesh& mesh, Real value) {
  ImposedLevelSet imposed;
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    if (mesh.point(n)[0] > 1e-12) continue;
    imposed.nodes.push_back(n);
    imposed.values.push_back(value);
  }
  return imposed;
}

TEST(Transport, TranslatesAPlaneExactlyAtAnyStep) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = unit_mesh(dim, 6);
    const NodeGraph graph = build_node_graph(mesh);
    const auto velocity = test::velocity_at_nodes(
        mesh,
        [](const Position&, Real) {
          return Position{0.5, 0, 0};
        },
        0);
    for (const Real dt : {0.01, 0.2, 1.5}) {
      for (const auto kind : {Stabilization::transient, Stabilization::residual_free_bubbles}) {
        LevelSetTransport transport(world(), mesh, graph, {kind, 0.5, 1e-12, 0});
        auto level_set = at_nodes(mesh, [](const Position& x) { return 0.1 - x[0]; });
        const auto report = transport.advance(velocity, level_set, dt, imposed_at_entry(mesh, 0.1 + 0.5 * dt));
        EXPECT_TRUE(report.converged);
        EXPECT_GE(report.substeps * 0.5 * 1.001, report.front_cfl);
        const auto exact = at_nodes(mesh, [dt](const Position& x) { return 0.1 + 0.5 * dt - x[0]; });
        EXPECT_LT(largest_difference(mesh, level_set, exact), 1e-10);
      }
    }
  }
}

TEST(Transport, VelocityOfSubscalesAddsToThatOfTheNodes) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = unit_mesh(dim, 6);
    const NodeGraph graph = build_node_graph(mesh);
    const auto shape = [](const Position& x) { return 0.3 - x[0] + 0.1 * x[1] * x[1]; };
    const auto components = static_cast<std::size_t>(dim);
    std::vector<Real> whole(static_cast<std::size_t>(mesh.nodes()) * components, 0.25);
    const std::vector<Real> half(whole.size(), 0.125);
    const std::vector<Real> subscales(static_cast<std::size_t>(mesh.elements()) * components, 0.125);
    auto expected = at_nodes(mesh, shape);
    auto level_set = expected;
    LevelSetTransport(world(), mesh, graph, {}).advance(whole, expected, 0.4, {});
    LevelSetTransport transport(world(), mesh, graph, {});
    transport.set_subscales(subscales);
    transport.advance(half, level_set, 0.4, {});
    EXPECT_LT(largest_difference(mesh, level_set, expected), 1e-12);
  }
}

TEST(Transport, LeavesTheLevelSetWhereNothingMoves) {
  const Mesh mesh = unit_mesh(3, 3);
  const NodeGraph graph = build_node_graph(mesh);
  const std::vector<Real> velocity(static_cast<std::size_t>(mesh.nodes()) * 3, 0);
  auto level_set = at_nodes(mesh, [](const Position& x) { return 0.3 - x[1]; });
  const auto before = level_set;
  const auto report = LevelSetTransport(world(), mesh, graph, {}).advance(velocity, level_set, 1, {});
  EXPECT_EQ(report.substeps, 1);
  EXPECT_EQ(largest_difference(mesh, level_set, before), 0);
}

TEST(Transport, ASlottedDiscTurnedOnceStaysBoundedAndInPlace) {
  const Mesh mesh = unit_mesh(2, 40);
  const NodeGraph graph = build_node_graph(mesh);
  const auto turning = [](const Position& x, Real) { return Position{0.5 - x[1], x[0] - 0.5, 0}; };
  const auto slotted_disc = [](const Position& x) {
    return std::min(signed_distance(Sphere{{0.5, 0.7, 0}, 0.2}, x),
                    -signed_distance(AxisBox{{0.5, 0.6, 0}, {0.08, 0.3, 0}, 2}, x));
  };
  auto level_set = at_nodes(mesh, slotted_disc);
  ImposedLevelSet rim;  // the flow enters and leaves through the boundary
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    const Real* x = mesh.point(n);
    const Real off_center = std::max(std::abs(x[0] - 0.5), std::abs(x[1] - 0.5));
    if (off_center < 0.5 - 1e-12) continue;
    rim.nodes.push_back(n);
    rim.values.push_back(level_set[static_cast<std::size_t>(n)]);
  }
  const auto velocity = test::velocity_at_nodes(mesh, turning, 0);
  LevelSetTransport transport(world(), mesh, graph, {Stabilization::transient, 1, 1e-5, 0});
  for (int turn = 0; turn < 4; ++turn) transport.advance(velocity, level_set, std::numbers::pi / 2, rim);
  const Real area = positive_volume(world(), mesh, element_measures(mesh, false),
                                    at_nodes(mesh, [&](const Position& x) { return slotted_disc(x); }));
  EXPECT_LT(test::misplaced_area(mesh, level_set, [&](const Position& x) { return slotted_disc(x) > 0; }), 0.2 * area);
  for (const Real value : level_set) EXPECT_LT(std::abs(value), 1);
}

TEST(Transport, IsBoundedFromTinyToHugeSteps) {
  const Mesh mesh = unit_mesh(2, 16);
  const NodeGraph graph = build_node_graph(mesh);
  const auto disc = [](const Position& x) { return signed_distance(Sphere{{0.5, 0.75, 0}, 0.15}, x); };
  for (const Real cfl : {0.05, 1.0, 50.0}) {
    const Real dt = cfl / 16 / 2;
    auto level_set = at_nodes(mesh, disc);
    LevelSetTransport transport(world(), mesh, graph, {});
    const auto velocity = test::velocity_at_nodes(mesh, test::vortex, 0);
    transport.advance(velocity, level_set, dt, {});
    for (const Real value : level_set) ASSERT_LT(std::abs(value), 2);
    if (cfl > 10) continue;  // a filament below an element by then
    const auto frozen = [](const Position& x, Real) { return test::vortex(x, 0); };
    const Real misplaced = test::misplaced_area(
        mesh, level_set, [&](const Position& x) { return disc(test::trace_back(frozen, x, dt, 64)) > 0; });
    EXPECT_LT(misplaced, 0.1 * std::numbers::pi * 0.15 * 0.15);
  }
}

TEST(Transport, NarrowBandMovesTheFrontAsTheWholeDoes) {
  const Mesh mesh = unit_mesh(2, 32);
  const NodeGraph graph = build_node_graph(mesh);
  const auto velocity = test::velocity_at_nodes(mesh, test::vortex, 0);
  const auto disc = [](const Position& x) { return signed_distance(Sphere{{0.5, 0.75, 0}, 0.15}, x); };
  auto whole = at_nodes(mesh, disc);
  auto band = whole;
  LevelSetTransport(world(), mesh, graph, {}).advance(velocity, whole, 0.2, {});
  LevelSetTransport(world(), mesh, graph, {Stabilization::transient, 0.5, 1e-5, 3}).advance(velocity, band, 0.2, {});
  const auto measures = element_measures(mesh, false);
  Real difference = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    difference += measures[static_cast<std::size_t>(e)] *
                  std::abs(positive_fraction(mesh, whole, e) - positive_fraction(mesh, band, e));
  }
  EXPECT_LT(world().sum(difference), 0.01 * std::numbers::pi * 0.15 * 0.15);
  EXPECT_GT(largest_difference(mesh, whole, band), 0.1);  // the band holds its width far away
}

TEST(Transport, MoreRanksThanElementsIsLegal) {
  const Mesh mesh = test::box_mesh(world(), {2, {1, 1, 1}, {0, 0, 0}, {1, 1, 0}, 0});
  const NodeGraph graph = build_node_graph(mesh);
  const auto velocity = test::velocity_at_nodes(
      mesh,
      [](const Position&, Real) {
        return Position{1, 0, 0};
      },
      0);
  auto level_set = at_nodes(mesh, [](const Position& x) { return 0.3 - x[0]; });
  LevelSetTransport(world(), mesh, graph, {}).advance(velocity, level_set, 0.3, imposed_at_entry(mesh, 0.6));
  EXPECT_NEAR(positive_volume(world(), mesh, element_measures(mesh, false), level_set), 0.6, 1e-4);
}

}  // namespace
}  // namespace malleus
