#include <gtest/gtest.h>

#include "level_set_cases.hpp"
#include "solvers/facet_distance.hpp"
#include "solvers/level_set_pockets.hpp"
#include "solvers/level_set_redistance.hpp"
#include "solvers/level_set_speed.hpp"
#include "solvers/level_set_transport.hpp"
#include "solvers/level_set_wetting.hpp"

namespace malleus {
namespace {

using test::at_nodes;
using test::position_of;
using test::world;

Mesh unit_mesh(int dim, int cells) {
  return test::box_mesh(world(), {dim, {cells, cells, cells}, {0, 0, 0}, {1, 1, 1}, 0.2});
}

TEST(FacetDistance, ToASingleSegmentAndTriangleIsExactEverywhere) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = unit_mesh(dim, 6);
    const NodeGraph graph = build_node_graph(mesh);
    DistanceFacet facet;
    facet.vertices = dim == 2 ? std::array<Real, 9>{0.2, 0.3, 0.4, 0.3}
                              : std::array<Real, 9>{0.2, 0.3, 0.5, 0.4, 0.3, 0.5, 0.2, 0.5, 0.5};
    std::vector<DistanceFacet> facets;
    if (mesh.elements() > 0 && world().rank() == 0) facets.push_back(facet);
    const auto distance = distance_to_facets(world(), mesh, graph, facets);
    for (LocalId n = 0; n < mesh.nodes(); ++n) {
      const Real* x = mesh.point(n);
      const Real exact =
          dim == 2 ? (closest_point<2>(Eigen::Map<Eigen::Matrix2d>(facet.vertices.data()), {x[0], x[1]}) -
                      Point<2>(x[0], x[1]))
                         .norm()
                   : (closest_point<3>(Eigen::Map<Eigen::Matrix3d>(facet.vertices.data()), {x[0], x[1], x[2]}) -
                      Point<3>(x[0], x[1], x[2]))
                         .norm();
      EXPECT_NEAR(distance[static_cast<std::size_t>(n)], exact, 1e-14);
    }
  }
}

TEST(CrossingRate, IsTheNormalSpeedOverTheSizeOfTheMesh) {
  for (const int dim : {2, 3}) {
    const int cells = 8;
    const Mesh mesh = test::box_mesh(world(), {.dim = dim, .cells = {cells, cells, cells}});
    const auto level_set = at_nodes(mesh, [](const Position& x) { return 0.53 - x[0]; });
    std::vector<Real> velocity(static_cast<std::size_t>(mesh.nodes()) * static_cast<std::size_t>(dim), 7);
    for (std::size_t i = 0; i < velocity.size(); i += static_cast<std::size_t>(dim)) velocity[i] = 3;
    // Edge of the regular simplex of an element's volume: h^2/2, h^3/6.
    const Real edge = (dim == 2 ? std::sqrt(2 / std::sqrt(3.0)) : std::cbrt(std::sqrt(2.0))) / cells;
    EXPECT_NEAR(front_crossing_rate(world(), mesh, node_sizes(mesh), velocity, level_set) * edge / 3, 1, 1e-9);
    const std::vector<Real> nowhere(level_set.size(), 1);
    EXPECT_EQ(front_crossing_rate(world(), mesh, node_sizes(mesh), velocity, nowhere), 0);
  }
}

TEST(CrossingRate, IsNotRuledBySlivers) {
  Mesh mesh = test::box_mesh(world(), {.dim = 2, .cells = {8, 8, 1}});
  const NodeGraph graph = build_node_graph(mesh);
  const auto level_set = at_nodes(mesh, [](const Position& x) { return 0.53 - x[0]; });
  std::vector<Real> velocity(2 * static_cast<std::size_t>(mesh.nodes()), 0);
  for (std::size_t i = 0; i < velocity.size(); i += 2) velocity[i] = 1;
  const auto rates = [&] {
    LevelSetTransport transport(world(), mesh, graph, {});
    return std::pair(front_crossing_rate(world(), mesh, node_sizes(mesh), velocity, level_set),
                     transport.front_rate(velocity, level_set));
  };
  const auto regular = rates();
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    Real* x = mesh.coordinates.data() + static_cast<std::size_t>(node) * 2;
    if (std::abs(x[0] - 0.5) < 1e-9 && std::abs(x[1] - 0.5) < 1e-9) x[0] += 0.125 * (1 - 1e-5);
  }
  const auto flat = rates();
  EXPECT_LT(flat.first, 1.5 * regular.first);
  EXPECT_LT(flat.second, 2 * regular.second);
}

TEST(Redistance, MakesADistanceOfADistortedSphereAndKeepsItsVolume) {
  for (const int dim : {2, 3}) {
    const Mesh mesh = unit_mesh(dim, 16);
    const NodeGraph graph = build_node_graph(mesh);
    const auto measures = element_measures(mesh, false);
    const Sphere sphere = {{0.5, 0.5, dim == 3 ? 0.5 : 0}, 0.3};
    auto level_set = at_nodes(mesh, [&](const Position& x) { return 20 * signed_distance(sphere, x) * (2 + x[0]); });
    const Real volume = positive_volume(world(), mesh, measures, level_set);
    EXPECT_TRUE(should_redistance(front_slope(world(), mesh, level_set)));
    redistance(world(), mesh, graph, measures, level_set);
    EXPECT_NEAR(positive_volume(world(), mesh, measures, level_set), volume, 1e-13);
    const FrontSlope slope = front_slope(world(), mesh, level_set);
    EXPECT_FALSE(should_redistance(slope));
    EXPECT_GT(slope.smallest, 0.6);
    EXPECT_LT(slope.largest, 1.7);
    for (LocalId n = 0; n < mesh.nodes(); ++n) {
      EXPECT_NEAR(level_set[static_cast<std::size_t>(n)], signed_distance(sphere, position_of(mesh, n)), 0.35 / 16);
    }
  }
}

TEST(Redistance, OfAPlaneThroughTheNodesKeepsIt) {
  const Mesh mesh = test::box_mesh(world(), {3, {4, 4, 4}, {0, 0, 0}, {1, 1, 1}, 0});
  const NodeGraph graph = build_node_graph(mesh);
  auto level_set = at_nodes(mesh, [](const Position& x) { return 5 * (0.5 - x[0]); });
  redistance(world(), mesh, graph, element_measures(mesh, false), level_set);
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    EXPECT_NEAR(level_set[static_cast<std::size_t>(n)], 0.5 - mesh.point(n)[0], 1e-8);
  }
}

TEST(Redistance, DoesNothingWithoutAFront) {
  const Mesh mesh = unit_mesh(2, 4);
  const NodeGraph graph = build_node_graph(mesh);
  auto level_set = at_nodes(mesh, [](const Position& x) { return 7 + x[0]; });
  const auto before = level_set;
  redistance(world(), mesh, graph, element_measures(mesh, false), level_set);
  EXPECT_EQ(level_set, before);
  EXPECT_FALSE(should_redistance(front_slope(world(), mesh, level_set)));
}

/// Marks of the planes y = 0 and y = 1.
std::vector<char> side_walls(const Mesh& mesh) {
  std::vector<char> is_wall;
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    const Real y = mesh.point(n)[1];
    is_wall.push_back(y < 1e-12 || y > 1 - 1e-12 ? 1 : 0);
  }
  return is_wall;
}

TEST(Wetting, AWallNodeTakesTheValueOfItsNearestInteriorNode) {
  const Mesh mesh = test::box_mesh(world(), {2, {8, 8, 1}, {0, 0, 0}, {1, 1, 0}, 0});
  const NodeGraph graph = build_node_graph(mesh);
  const WallWetting wetting(world(), mesh, graph, side_walls(mesh));
  EXPECT_EQ(wetting.nodes_without_interior(), 0);
  auto level_set = at_nodes(mesh, [](const Position& x) { return x[0] + 10 * x[1]; });
  wetting.apply(level_set);
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    const Real y = std::min(std::max(mesh.point(n)[1], 0.125), 0.875);
    const Real lag = 0.01 * std::abs(y - mesh.point(n)[1]);
    EXPECT_NEAR(level_set[static_cast<std::size_t>(n)], mesh.point(n)[0] + 10 * y - lag, 1e-14);
  }
}

TEST(Wetting, ReachesNodesWithoutAnInteriorNeighbour) {
  // All nodes of the lower half lie on the wall: values arrive from above, row by row.
  const Mesh mesh = test::box_mesh(world(), {2, {4, 8, 1}, {0, 0, 0}, {1, 1, 0}, 0});
  const NodeGraph graph = build_node_graph(mesh);
  std::vector<char> is_wall;
  for (LocalId n = 0; n < mesh.nodes(); ++n) is_wall.push_back(mesh.point(n)[1] < 0.51 ? 1 : 0);
  const WallWetting wetting(world(), mesh, graph, is_wall);
  EXPECT_EQ(wetting.nodes_without_interior(), 4 * 5);
  auto level_set = at_nodes(mesh, [](const Position& x) { return x[0] + 10 * x[1]; });
  wetting.apply(level_set);
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    const Real y = std::max(mesh.point(n)[1], 0.625);
    const Real lag = 0.01 * (y - mesh.point(n)[1]);
    EXPECT_NEAR(level_set[static_cast<std::size_t>(n)], mesh.point(n)[0] + 10 * y - lag, 1e-14);
  }
}

TEST(Wetting, WithoutAnyInteriorNodeNothingIsGiven) {
  const Mesh mesh = unit_mesh(2, 2);
  const NodeGraph graph = build_node_graph(mesh);
  const std::vector<char> is_wall(static_cast<std::size_t>(mesh.nodes()), 1);
  const WallWetting wetting(world(), mesh, graph, is_wall);
  auto level_set = at_nodes(mesh, [](const Position& x) { return x[0]; });
  const auto before = level_set;
  wetting.apply(level_set);
  EXPECT_EQ(level_set, before);
}

/// A large and a small bubble of air inside, a small one at a side.
struct Bubbles {
  explicit Bubbles(int dim) : mesh(unit_mesh(dim, 16)) {
    const Real middle = dim == 3 ? 0.5 : 0;
    large = {{0.3, 0.5, middle}, 0.2};
    level_set = at_nodes(mesh, [&](const Position& x) {
      return -std::max({signed_distance(large, x), signed_distance(Sphere{{0.75, 0.5, middle}, 0.07}, x),
                        signed_distance(Sphere{{1, 0.8, middle}, 0.07}, x)});
    });
    open.assign(level_set.size(), 0);
  }
  void open_side() {
    for (LocalId n = 0; n < mesh.nodes(); ++n) open[static_cast<std::size_t>(n)] = mesh.point(n)[0] > 1 - 1e-9 ? 1 : 0;
  }
  Mesh mesh;
  Sphere large;
  std::vector<Real> level_set;
  std::vector<char> open;
};

TEST(UnresolvedPockets, AreFilledAndLargeOnesKept) {
  for (const int dim : {2, 3}) {
    Bubbles scene(dim);
    const auto before = scene.level_set;
    EXPECT_EQ(fill_unresolved_pockets(world(), scene.mesh, scene.open, scene.level_set), 2);
    for (LocalId n = 0; n < scene.mesh.nodes(); ++n) {
      const auto node = static_cast<std::size_t>(n);
      if (signed_distance(scene.large, position_of(scene.mesh, n)) > -0.02) {
        EXPECT_EQ(scene.level_set[node], before[node]);
      } else {
        EXPECT_GT(scene.level_set[node], 0);
        EXPECT_GE(scene.level_set[node], std::abs(before[node]));
      }
    }
    EXPECT_EQ(fill_unresolved_pockets(world(), scene.mesh, scene.open, scene.level_set), 0);
  }
}

TEST(UnresolvedPockets, AreLeftWhereAirCanLeave) {
  for (const int dim : {2, 3}) {
    Bubbles scene(dim);
    scene.open_side();
    EXPECT_EQ(fill_unresolved_pockets(world(), scene.mesh, scene.open, scene.level_set), 1);
  }
}

}  // namespace
}  // namespace malleus
