#include "forge/contact_couplings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "partition/partition.hpp"
#include "support/world.hpp"
#include "two_boxes.hpp"

namespace malleus::forge {
namespace {

using malleus::test::world;
using test::Layout;

/// Two blocks side by side along x, of lengths that make a partition blind to the contact cut one of them lengthwise.
Mesh two_blocks(int dim, Layout layout) {
  Mesh mesh = test::two_boxes(world(), {.dim = dim, .cells = {12, 6, 4}, .high = {2, 1, 1}},
                              {.dim = dim, .cells = {12, 6, 4}, .low = {0, 1, 0}, .high = {2, 2, 1}});
  test::lay_out(world(), mesh, layout);
  return mesh;
}

std::vector<NodeCoupling> couplings_of(const Mesh& mesh) {
  const std::vector<char> is_free(mesh.group_names.size() + 1, 1);
  const FreeSurface surface(world(), mesh, Geometry::plane, is_free);
  return couple_pairs(mesh, find_pairs(world(), surface, test::positions_of(mesh), {1, 0, 0.05}));
}

class ContactCouplings : public testing::TestWithParam<int> {};

TEST_P(ContactCouplings, AreEachSlaveNodeWithTheNodesOfItsFacet) {
  const Mesh mesh = two_blocks(GetParam(), Layout::scattered);
  const auto count = world().sum(static_cast<GlobalId>(couplings_of(mesh).size()));
  EXPECT_EQ(count, GetParam() == 2 ? 13 * 2 : 13 * 5 * 3);
}

TEST_P(ContactCouplings, KeepPairsTogether) {
  const Mesh mesh = two_blocks(GetParam(), Layout::as_built);
  WorkModel blind;
  WorkModel aware;
  aware.couplings = couplings_of(mesh);
  const WorkGraph graph = build_work_graph(world(), mesh, element_work(world(), mesh, aware), aware.couplings);
  for (const int parts : {2, 4}) {
    const Architecture machine = equal_architecture(parts);
    const std::vector<int> apart = make_partition(world(), mesh, blind, machine, {}).parts;
    const PartitionCost before = partition_cost(world(), mesh, graph, aware, machine, apart);
    const PartitionPlan together = make_partition(world(), mesh, aware, machine, {});
    EXPECT_LT(together.after.cut_couplings, before.cut_couplings) << parts;
    EXPECT_EQ(make_partition(world(), mesh, aware, machine, {}, apart).before.cut_couplings, before.cut_couplings);
  }
}

TEST_P(ContactCouplings, CountWhatThePartsCut) {
  const Mesh mesh = two_blocks(GetParam(), Layout::scattered);
  WorkModel model;
  model.couplings = couplings_of(mesh);
  const WorkGraph graph = build_work_graph(world(), mesh, element_work(world(), mesh, model), model.couplings);
  std::vector<int> by_body(mesh.element_region.begin(), mesh.element_region.end());
  const PartitionCost all = partition_cost(world(), mesh, graph, model, equal_architecture(2), by_body);
  EXPECT_EQ(all.cut_couplings, world().sum(static_cast<GlobalId>(model.couplings.size())));
  EXPECT_EQ(all.cut, 0);  // couplings are no faces
  WorkModel none;
  const WorkGraph plain = build_work_graph(world(), mesh, element_work(world(), mesh, none));
  const PartitionCost without = partition_cost(world(), mesh, plain, none, equal_architecture(2), by_body);
  EXPECT_NEAR(all.times[0] - without.times[0],
              contact_coupling * static_cast<Real>(all.cut_couplings) / without.ideal_time, 1e-9);
  EXPECT_EQ(without.cut_couplings, 0);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, ContactCouplings, testing::Values(2, 3));

}  // namespace
}  // namespace malleus::forge
