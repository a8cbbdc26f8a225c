#include "partition/partition.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "base/error.hpp"
#include "partition/interface_release.hpp"
#include "partition/node_parts.hpp"
#include "partition/scotch_start.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

Mesh box(int dim, int cells) {
  test::BoxMeshOptions options;
  options.dim = dim;
  options.cells = {2 * cells, cells, cells};
  options.high = {2, 1, 1};
  return test::box_mesh(world(), options);
}

/// Weights at which little but balance counts, so that shares can be foreseen.
WorkModel paper_times() {
  WorkModel model;
  model.node = 100;
  return model;
}

/// Parts as numbers of the given count, all elements of all ranks among them.
void expect_parts(const Mesh& mesh, const std::vector<int>& parts, int n_parts) {
  ASSERT_EQ(parts.size(), static_cast<std::size_t>(mesh.elements()));
  for (const int part : parts) {
    EXPECT_GE(part, 0);
    EXPECT_LT(part, n_parts);
  }
}

class Partitions : public testing::TestWithParam<int> {};

TEST_P(Partitions, AreBalancedInOnePieceAndBeatTheCurve) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 20 : 6);
  for (const int n_parts : {2, 7}) {
    const Architecture machine = equal_architecture(n_parts);
    PartitionOptions options;
    options.tolerance = 0.03;
    const PartitionPlan plan = make_partition(world(), mesh, paper_times(), machine, options);
    expect_parts(mesh, plan.parts, n_parts);
    EXPECT_LE(plan.after.imbalance, 0.035) << n_parts;
    EXPECT_EQ(plan.after.stray_pieces, 0);
    EXPECT_EQ(plan.after.empty_parts, 0);
    options.method = Partitioner::curve;
    const PartitionPlan curve = make_partition(world(), mesh, paper_times(), machine, options);
    EXPECT_LE(plan.after.cut, curve.after.cut);
    EXPECT_EQ(curve.made_by, "curve");
  }
}

TEST_P(Partitions, FollowTheSpeedsOfTheProcessors) {
  // On smaller meshes what is exchanged weighs so much that balance gives way to it.
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 24 : 10);
  Architecture machine = equal_architecture(4);
  machine.speed = {1, 2, 3, 4};
  const PartitionPlan plan = make_partition(world(), mesh, paper_times(), machine, {});
  EXPECT_LE(plan.after.imbalance, 0.2);  // the work is shifted to where less is exchanged
  std::vector<Real> counts(4, 0);
  for (const int part : plan.parts) counts[static_cast<std::size_t>(part)] += 1;
  world().sum_in_place(std::span<Real>(counts));
  for (std::size_t p = 0; p < 4; ++p) {
    EXPECT_NEAR(counts[p] / static_cast<Real>(mesh.total_elements), machine.speed[p] / 10, 0.04);
  }
}

TEST_P(Partitions, AvoidSlowLinks) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 20 : 7);
  Architecture machine = equal_architecture(4);
  machine.cluster = {0, 0, 1, 1};
  machine.cluster_bandwidth = 0.05;
  const PartitionPlan blind = make_partition(world(), mesh, paper_times(), equal_architecture(4), {});
  WorkModel model = paper_times();
  const WorkGraph graph = build_work_graph(world(), mesh, element_work(world(), mesh, model));
  const PartitionPlan aware = make_partition(world(), mesh, model, machine, {});
  EXPECT_LE(aware.after.cost, partition_cost(world(), mesh, graph, model, machine, blind.parts).cost + 1e-12);
}

TEST_P(Partitions, StartFromWhateverIsAskedFor) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 16 : 6);
  PartitionOptions options;
  for (const auto& [start, name] :
       {std::pair(PartitionStart::curve, "curve"), std::pair(PartitionStart::coordinate, "coordinate bisection"),
        std::pair(PartitionStart::inertial, "inertial bisection"), std::pair(PartitionStart::growth, "growth"),
        std::pair(PartitionStart::scotch, "PT-Scotch")}) {
    options.start = start;
    if (start == PartitionStart::scotch && !has_scotch()) {
      EXPECT_THROW(make_partition(world(), mesh, paper_times(), equal_architecture(4), options), InputError);
      continue;
    }
    const PartitionPlan plan = make_partition(world(), mesh, paper_times(), equal_architecture(4), options);
    expect_parts(mesh, plan.parts, 4);
    EXPECT_EQ(plan.made_by, std::string(name) + " and refinement");
    EXPECT_LE(plan.after.imbalance, 0.03) << name;
    EXPECT_EQ(plan.after.empty_parts, 0) << name;
    EXPECT_EQ(plan.parts, make_partition(world(), mesh, paper_times(), equal_architecture(4), options).parts) << name;
  }
  const Mesh tiny = box(GetParam(), 1);
  expect_parts(tiny, make_partition(world(), tiny, paper_times(), equal_architecture(50), options).parts, 50);
}

TEST_P(Partitions, AreTheSameTwice) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 12 : 4);
  const auto make = [&] { return make_partition(world(), mesh, paper_times(), equal_architecture(5), {}); };
  const PartitionPlan first = make();
  const PartitionPlan second = make();
  EXPECT_EQ(first.parts, second.parts);
  EXPECT_EQ(first.after.times, second.after.times);
}

TEST_P(Partitions, APlanWithoutGainMovesNothing) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 12 : 4);
  const Architecture machine = equal_architecture(3);
  PartitionPlan plan = make_partition(world(), mesh, paper_times(), machine, {});
  for (int round = 0; round < 4 && (round == 0 || plan.moved_elements > 0); ++round) {
    plan = make_partition(world(), mesh, paper_times(), machine, {}, plan.parts);
  }
  EXPECT_EQ(plan.moved_elements, 0);
  EXPECT_EQ(plan.moved, 0);
  EXPECT_EQ(plan.after.cost, plan.before.cost);
}

TEST_P(Partitions, PlansAreToldComparedAndRefused) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 16 : 5);
  const Architecture machine = equal_architecture(4);
  PartitionOptions options;
  options.method = Partitioner::curve;
  const PartitionPlan curve = make_partition(world(), mesh, paper_times(), machine, options);
  const PartitionPlan better = make_partition(world(), mesh, paper_times(), machine, {}, curve.parts);
  EXPECT_EQ(count_differences(world(), curve, curve), 0);
  EXPECT_EQ(count_differences(world(), curve, better), better.moved_elements);
  EXPECT_NE(describe_plan(better).find("4 parts by " + better.made_by), std::string::npos);
  EXPECT_GT(better.count.rounds, 0);
  EXPECT_LE(better.count.flow_rounds, 10);
  EXPECT_EQ(better.count.messages, 2 * better.count.pairs);
  PartitionPlan plan = better;
  plan.before.cost = 1.2;
  plan.after.cost = 1.1;
  plan.moved = 0.5;
  plan.moved_elements = 7;
  EXPECT_TRUE(is_worth_moving(plan, {}, 0.02));
  EXPECT_FALSE(is_worth_moving(plan, {}, 0.1));  // too little gained
  options.moving_cost = 0.3;
  EXPECT_FALSE(is_worth_moving(plan, options, 0.02));  // moving costs more
  plan.moved_elements = 0;
  EXPECT_FALSE(is_worth_moving(plan, {}, 0));
}

TEST_P(Partitions, ARepairNeverCostsMoreAndMovesLess) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 20 : 6);
  const Architecture machine = equal_architecture(6);
  const PartitionPlan even = make_partition(world(), mesh, paper_times(), machine, {});
  WorkModel model = paper_times();
  model.factor.assign(static_cast<std::size_t>(mesh.elements()), 1);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    if (mesh.point(mesh.nodes_of_element(e)[0])[0] < 0.2) model.factor[static_cast<std::size_t>(e)] = 2;
  }
  const PartitionPlan repaired = make_partition(world(), mesh, model, machine, {}, even.parts);
  EXPECT_LT(repaired.after.cost, repaired.before.cost);
  EXPECT_LE(repaired.after.imbalance, 0.05);
  EXPECT_GT(repaired.moved, 0);
  EXPECT_LT(repaired.moved, 0.5);
}

TEST_P(Partitions, TakeAnyWeightsAndMorePartsThanElements) {
  const Mesh mesh = box(GetParam(), 1);
  const int n_parts = 100;
  const PartitionPlan plan = make_partition(world(), mesh, paper_times(), equal_architecture(n_parts), {});
  expect_parts(mesh, plan.parts, n_parts);
  EXPECT_GE(plan.after.empty_parts, n_parts - mesh.total_elements);
  WorkModel model = paper_times();
  for (LocalId e = 0; e < mesh.elements(); ++e) model.factor.push_back(e % 3 == 0 ? 0 : e % 3 == 1 ? 1 : 1e9);
  expect_parts(mesh, make_partition(world(), mesh, model, equal_architecture(3), {}).parts, 3);
  model.factor.assign(model.factor.size(), 0);
  EXPECT_THROW(make_partition(world(), mesh, model, equal_architecture(3), {}), InputError);
}

TEST_P(Partitions, TakeBodiesThatDoNotHangTogether) {
  test::BoxMeshOptions options;
  options.dim = GetParam();
  options.cells = {8, 8, GetParam() == 2 ? 0 : 4};
  MeshPiece piece = test::box_piece(world(), options);
  const GlobalId stride = 1000000;  // the elements right of the middle get nodes of their own
  MeshPiece parted = piece;
  parted.node_numbers.clear();
  parted.coordinates.clear();
  parted.element_nodes.clear();
  parted.facet_nodes.clear();
  parted.facet_group.clear();
  std::map<GlobalId, LocalId> places;
  const auto dim = static_cast<std::size_t>(piece.dim);
  for (std::size_t e = 0; e < piece.element_region.size(); ++e) {
    Real x = 0;
    for (std::size_t i = 0; i <= dim; ++i) {
      x += piece.coordinates[static_cast<std::size_t>(piece.element_nodes[e * (dim + 1) + i]) * dim];
    }
    for (std::size_t i = 0; i <= dim; ++i) {
      const auto node = static_cast<std::size_t>(piece.element_nodes[e * (dim + 1) + i]);
      const bool is_right = x / static_cast<Real>(dim + 1) > 0.5;
      const GlobalId number = piece.node_numbers[node] + (is_right ? stride : 0);
      const auto [place, is_new] = places.try_emplace(number, static_cast<LocalId>(places.size()));
      if (is_new) {
        parted.node_numbers.push_back(number);
        const Real* point = piece.coordinates.data() + node * dim;
        parted.coordinates.insert(parted.coordinates.end(), point, point + dim);
      }
      parted.element_nodes.push_back(place->second);
    }
  }
  const Mesh mesh = assemble_mesh(world(), parted).mesh;
  const PartitionPlan two = make_partition(world(), mesh, paper_times(), equal_architecture(2), {});
  EXPECT_EQ(two.after.cut, 0);
  EXPECT_NEAR(two.after.imbalance, 0, 1e-9);
  const PartitionPlan five = make_partition(world(), mesh, paper_times(), equal_architecture(5), {});
  EXPECT_LE(five.after.imbalance, 0.1);  // parts wholly in one body would make it 0.25
  EXPECT_EQ(five.after.empty_parts, 0);
}

TEST_P(Partitions, StripsLowerTheCostOfAnUnevenStart) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 20 : 6);
  std::vector<int> slabs;  // of widths 0.3, 1.1, 0.6
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const Real x = mesh.point(mesh.nodes_of_element(e)[0])[0];
    slabs.push_back(x < 0.3 ? 0 : x < 1.4 ? 1 : 2);
  }
  PartitionOptions options;
  options.method = Partitioner::strips;
  const PartitionPlan plan = make_partition(world(), mesh, paper_times(), equal_architecture(3), options, slabs);
  EXPECT_LT(plan.after.cost, plan.before.cost - 0.3);
  EXPECT_LT(plan.after.imbalance, 0.25);  // whole strips: no nearer than half of one
  EXPECT_GT(plan.moved, 0.1);
  EXPECT_LT(plan.moved, 0.6);
}

TEST_P(Partitions, AGivenPartitionIsScoredAsItIs) {
  const Mesh mesh = box(GetParam(), 4);
  std::vector<int> slabs;
  for (LocalId e = 0; e < mesh.elements(); ++e) slabs.push_back(mesh.point(mesh.nodes_of_element(e)[0])[0] < 1 ? 0 : 1);
  PartitionOptions options;
  options.method = Partitioner::keep;
  const PartitionPlan plan = make_partition(world(), mesh, paper_times(), equal_architecture(2), options, slabs);
  EXPECT_EQ(plan.parts, slabs);
  EXPECT_EQ(plan.after.cost, plan.before.cost);
  EXPECT_EQ(plan.moved_elements, 0);
}

TEST_P(Partitions, BordersMoveInside) {
  const Mesh mesh = box(GetParam(), GetParam() == 2 ? 20 : 6);
  const Architecture machine = equal_architecture(4);
  const PartitionPlan plan = make_partition(world(), mesh, paper_times(), machine, {});
  const std::vector<Real> work(static_cast<std::size_t>(mesh.elements()), 1);
  ReleaseOptions options;
  options.aim = ReleaseAim::most_released;
  const Release shifted = move_interfaces_inside(world(), mesh, work, machine, plan.parts, options);
  expect_parts(mesh, shifted.parts, 4);
  EXPECT_GT(shifted.interface_nodes, 0);
  EXPECT_LE(shifted.still, shifted.interface_nodes / 5);
  EXPECT_LT(shifted.moved_elements, mesh.total_elements / 2);
  options.aim = ReleaseAim::equal_loads;
  const Release balanced = move_interfaces_inside(world(), mesh, work, machine, plan.parts, options);
  EXPECT_LE(balanced.imbalance, 0.1);
  EXPECT_LE(balanced.still, balanced.interface_nodes / 2);
  expect_parts(mesh, move_interfaces_inside(world(), mesh, work, options).parts, world().size());
}

/// Two parts, one border: half of the strip goes to each, on the old border only the line between the halves stays.
TEST_P(Partitions, StripsAlongBordersAreSharedOut) {
  const int cells = GetParam() == 2 ? 40 : 12;
  const Mesh mesh = box(GetParam(), cells);
  std::vector<int> halves;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    Real x = 0;
    for (const LocalId node : mesh.nodes_of_element(e)) x += mesh.point(node)[0] / (mesh.dim + 1);
    halves.push_back(x < 1 ? 0 : 1);
  }
  const std::vector<Real> work(static_cast<std::size_t>(mesh.elements()), 1);
  ReleaseOptions options;
  options.aim = ReleaseAim::equal_strips;
  options.layers = 3;
  const Release release = move_interfaces_inside(world(), mesh, work, equal_architecture(2), halves, options);
  std::array<GlobalId, 2> taken = {0, 0};
  for (std::size_t e = 0; e < halves.size(); ++e) {
    if (release.parts[e] != halves[e]) ++taken[static_cast<std::size_t>(release.parts[e])];
  }
  world().sum_in_place(taken);
  EXPECT_GT(taken[0], 0);
  EXPECT_NEAR(static_cast<Real>(taken[0]), static_cast<Real>(taken[1]), 0.2 * static_cast<Real>(taken[0]));
  EXPECT_LE(release.still, release.interface_nodes / (GetParam() == 2 ? 10 : 4));
  EXPECT_LT(release.imbalance, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Partitions, testing::Values(2, 3));

TEST(PartitionCosts, AreThoseCountedByHand) {
  test::BoxMeshOptions options;  // two cells of two triangles: one part each
  options.dim = 2;
  options.cells = {2, 1, 0};
  const Mesh mesh = test::box_mesh(world(), options);
  WorkModel model = paper_times();
  model.element = 1;
  model.node = 10;
  model.communication = 2;
  Architecture machine = equal_architecture(2);
  machine.speed = {1, 2};
  machine.bandwidth = 4;
  std::vector<int> parts;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    Real x = 0;
    for (const LocalId node : mesh.nodes_of_element(e)) x += mesh.point(node)[0] / 3;
    parts.push_back(x > 0.5 ? 1 : 0);
  }
  const WorkGraph graph = build_work_graph(world(), mesh, element_work(world(), mesh, model));
  const PartitionCost cost = partition_cost(world(), mesh, graph, model, machine, parts);
  // 4 elements and 6 nodes: 64 of work, speed 3. The two middle nodes are split; both go to the faster part.
  EXPECT_DOUBLE_EQ(cost.ideal_time, 64.0 / 3);
  EXPECT_EQ(cost.cut, 1);
  EXPECT_EQ(cost.communication_volume, 2);
  EXPECT_EQ(cost.interface_nodes, 2);
  EXPECT_EQ(cost.max_neighbours, 1);
  EXPECT_EQ(cost.empty_parts, 0);
  EXPECT_EQ(cost.stray_pieces, 0);
  // Edges between {0, 3} and the four others: two along x and one of the diagonals.
  EXPECT_EQ(cost.cut_edges, 3);
  EXPECT_DOUBLE_EQ(cost.times[0], (22 + 2 * 4 / 4.0) / cost.ideal_time);
  EXPECT_DOUBLE_EQ(cost.times[1], (42 / 2.0 + 2 * 4 / 4.0) / cost.ideal_time);
  EXPECT_DOUBLE_EQ(cost.cost, std::max(cost.times[0], cost.times[1]));
}

}  // namespace
}  // namespace malleus
