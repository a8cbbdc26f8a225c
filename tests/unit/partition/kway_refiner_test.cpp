#include "partition/kway_refiner.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "partition/grow_bisect.hpp"

namespace malleus {
namespace {

/// A grid of so many vertices of weight 1, each joined with those beside it; bodies side by side that do not touch.
WorkGraph grid(int columns, int rows, int bodies = 1) {
  WorkGraph graph;
  const LocalId size = columns * rows;
  graph.start = {0};
  for (LocalId v = 0; v < bodies * size; ++v) {
    const LocalId x = v % size % columns;
    const LocalId y = v % size / columns;
    const auto add = [&](bool is_there, LocalId other) {
      if (!is_there) return;
      graph.neighbours.push_back(other);
      graph.edge_weights.push_back(1);
    };
    add(x > 0, v - 1);
    add(x + 1 < columns, v + 1);
    add(y > 0, v - columns);
    add(y + 1 < rows, v + columns);
    graph.start.push_back(static_cast<std::int64_t>(graph.neighbours.size()));
    graph.weights.push_back(1);
  }
  return graph;
}

int cut_of(const WorkGraph& graph, const std::vector<int>& parts) {
  int cut = 0;
  for (LocalId v = 0; v < graph.owned(); ++v) {
    for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
      const LocalId other = graph.neighbours[j];
      if (other > v && parts[static_cast<std::size_t>(v)] != parts[static_cast<std::size_t>(other)]) ++cut;
    }
  }
  return cut;
}

std::vector<Real> loads_of(const WorkGraph& graph, const std::vector<int>& parts, int n_parts) {
  std::vector<Real> loads(static_cast<std::size_t>(n_parts), 0);
  for (std::size_t v = 0; v < parts.size(); ++v) loads[static_cast<std::size_t>(parts[v])] += graph.weights[v];
  return loads;
}

/// Quarters of a grid of 24 x 24, each in its place but for a third of the vertices.
std::vector<int> frayed_quarters() {
  std::vector<int> parts(576);
  for (int v = 0; v < 576; ++v) {
    const int quarter = (v % 24 >= 12 ? 1 : 0) + (v / 24 >= 12 ? 2 : 0);
    parts[static_cast<std::size_t>(v)] = v * 7 % 12 < 4 ? (quarter + v) % 4 : quarter;
  }
  return parts;
}

TEST(KwayRefiner, FindsSmoothBordersWithinTheLoadsAllowed) {
  const WorkGraph graph = grid(24, 24);
  const Architecture machine = equal_architecture(4);
  std::vector<int> parts = frayed_quarters();
  const int before = cut_of(graph, parts);
  std::vector<Real> loads = loads_of(graph, parts, 4);
  const std::vector<Real> targets(4, 144);
  EXPECT_GT(refine_kway(graph, machine, parts, loads, targets, {0.05, 10, 30}), 0);
  EXPECT_LE(cut_of(graph, parts), before / 4);
  EXPECT_EQ(loads, loads_of(graph, parts, 4));
  for (const Real load : loads) EXPECT_LE(load, 1.05 * 144);
}

TEST(KwayRefiner, LeavesWhatCannotBeBetter) {
  const WorkGraph graph = grid(20, 10);
  std::vector<int> parts(200);
  for (std::size_t v = 0; v < parts.size(); ++v) parts[v] = v % 20 < 10 ? 0 : 1;
  const std::vector<int> before = parts;
  std::vector<Real> loads = {100, 100};
  EXPECT_EQ(refine_kway(graph, equal_architecture(2), parts, loads, std::vector<Real>{100, 100}, {0.02, 5, 30}), 0);
  EXPECT_EQ(parts, before);
}

TEST(KwayRefiner, PartsWithTooMuchDoNotGrow) {
  const WorkGraph graph = grid(30, 10);
  std::vector<int> parts(300);
  for (std::size_t v = 0; v < parts.size(); ++v) parts[v] = v % 30 < 20 + v / 30 % 2 ? 0 : 1;
  std::vector<Real> loads = loads_of(graph, parts, 2);
  const Real before = loads[0];
  refine_kway(graph, equal_architecture(2), parts, loads, std::vector<Real>{150, 150}, {0.01, 3, 30});
  EXPECT_LE(loads[0], before);
}

TEST(KwayRefiner, AvoidsSlowLinks) {
  // Parts in a row of four; the slow link is first in the middle of the grid's short side, where few edges cross.
  const WorkGraph graph = grid(40, 10);
  Architecture machine = equal_architecture(4);
  machine.cluster = {0, 0, 1, 1};
  machine.cluster_bandwidth = 0.05;
  std::vector<int> parts(400);
  for (std::size_t v = 0; v < parts.size(); ++v) {
    const std::size_t x = v % 40;
    const std::size_t y = v / 40;
    parts[v] = static_cast<int>(x / 10);
    if (x >= 17 && x < 23 && y % 3 == 0) parts[v] = x < 20 ? 2 : 1;  // a frayed slow border
  }
  std::vector<Real> loads = loads_of(graph, parts, 4);
  refine_kway(graph, machine, parts, loads, std::vector<Real>(4, 100), {0.1, 10, 30});
  int slow = 0;
  for (LocalId v = 0; v + 1 < graph.owned(); ++v) {
    const bool is_low = parts[static_cast<std::size_t>(v)] < 2;
    if (v % 40 < 39 && is_low != (parts[static_cast<std::size_t>(v) + 1] < 2)) ++slow;
  }
  EXPECT_EQ(slow, 10);
}

TEST(GrowBisect, DividesAStripAcross) {
  const WorkGraph graph = grid(64, 1);
  const std::vector<int> parts = grow_bisect(Communicator(MPI_COMM_SELF), graph, std::vector<Real>{1, 1, 1, 1});
  EXPECT_EQ(cut_of(graph, parts), 3);
  EXPECT_EQ(loads_of(graph, parts, 4), std::vector<Real>(4, 16));
}

TEST(GrowBisect, FollowsTheShares) {
  const WorkGraph graph = grid(30, 20);
  const std::vector<int> parts = grow_bisect(Communicator(MPI_COMM_SELF), graph, std::vector<Real>{3, 1, 2});
  const std::vector<Real> loads = loads_of(graph, parts, 3);
  EXPECT_NEAR(loads[0], 300, 9);
  EXPECT_NEAR(loads[1], 100, 6);
  EXPECT_NEAR(loads[2], 200, 9);
}

TEST(GrowBisect, GivesEachOfTwoBodiesItsPart) {
  const WorkGraph graph = grid(12, 12, 2);
  const std::vector<int> parts = grow_bisect(Communicator(MPI_COMM_SELF), graph, std::vector<Real>{1, 1});
  EXPECT_EQ(cut_of(graph, parts), 0);
  EXPECT_EQ(loads_of(graph, parts, 2), std::vector<Real>(2, 144));
}

TEST(GrowBisect, TakesMorePartsThanVertices) {
  const WorkGraph graph = grid(3, 1);
  const std::vector<int> parts = grow_bisect(Communicator(MPI_COMM_SELF), graph, std::vector<Real>(8, 1));
  ASSERT_EQ(parts.size(), 3u);
  for (const int part : parts) EXPECT_TRUE(part >= 0 && part < 8);
}

}  // namespace
}  // namespace malleus
