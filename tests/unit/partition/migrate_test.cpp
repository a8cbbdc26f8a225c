#include "partition/migrate.hpp"

#include <gtest/gtest.h>

#include "partition/balance.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

/// A box mesh with fields whose values follow from the place, so that they can be checked anywhere.
struct Scene {
  Mesh mesh;
  FieldStore fields;

  explicit Scene(int dim) {
    test::BoxMeshOptions box;
    box.dim = dim;
    box.cells = {6, 3, 4};
    mesh = test::box_mesh(world(), box);
    Field& velocity = fields.declare(mesh, {"velocity", "m/s", Support::node, dim});
    std::copy(mesh.coordinates.begin(), mesh.coordinates.end(), velocity.values().begin());
    Field& mark = fields.declare(mesh, {"mark", "1", Support::element, 1});
    for (LocalId e = 0; e < mesh.elements(); ++e) *mark.at(e) = static_cast<Real>(mesh.element_ids[e]);
    Field& clock = fields.declare(mesh, {"clock", "s", Support::domain, 1});
    *clock.at(0) = 7;
  }

  void expect_sound() {
    EXPECT_EQ(mesh.total_nodes(), mesh.dim == 3 ? 7 * 4 * 5 : 7 * 4);
    EXPECT_EQ(world().sum(static_cast<GlobalId>(mesh.exterior_facets)), mesh.dim == 3 ? 4 * (18 + 24 + 12) : 18);
    EXPECT_EQ(world().sum(static_cast<GlobalId>(mesh.owned_nodes())), mesh.total_nodes());
    const auto velocity = fields["velocity"].values();
    EXPECT_TRUE(std::equal(velocity.begin(), velocity.end(), mesh.coordinates.begin(), mesh.coordinates.end()));
    GlobalId id_sum = 0;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      EXPECT_EQ(*fields["mark"].at(e), static_cast<Real>(mesh.element_ids[e]));
      id_sum += mesh.element_ids[e];
    }
    const GlobalId n = mesh.total_elements;
    EXPECT_EQ(world().sum(id_sum), n * (n - 1) / 2);
    EXPECT_EQ(*fields["clock"].at(0), 7);
    for (LocalId f = 0; f < mesh.facets(); ++f) EXPECT_GE(mesh.facet_group[f], 0);
  }
};

class Migration : public testing::TestWithParam<int> {};

TEST_P(Migration, APlanThatMovesNothingMovesNothing) {
  Scene scene(GetParam());
  const std::vector<LocalId> before = scene.mesh.element_nodes;
  const std::vector<int> stay(static_cast<std::size_t>(scene.mesh.elements()), world().rank());
  EXPECT_EQ(migrate(world(), scene.mesh, scene.fields, stay).moved_elements, 0);
  EXPECT_EQ(scene.mesh.element_nodes, before);
}

TEST_P(Migration, AnyPlanKeepsMeshAndFields) {
  Scene scene(GetParam());
  for (int round = 0; round < 5; ++round) {
    std::vector<int> plan;
    for (const GlobalId id : scene.mesh.element_ids)
      plan.push_back(static_cast<int>((id * 7 + round * id / 3) % world().size()));
    migrate(world(), scene.mesh, scene.fields, plan);
    scene.expect_sound();
  }
}

TEST_P(Migration, LongMessagesGoInPieces) {
  Scene scene(GetParam());
  constexpr std::size_t piece_bytes = 100;  // a fraction of any of the messages
  std::vector<int> destinations(static_cast<std::size_t>(scene.mesh.elements()));
  for (LocalId e = 0; e < scene.mesh.elements(); ++e)
    destinations[static_cast<std::size_t>(e)] = (world().rank() + 1 + e % 2) % world().size();
  migrate(world(), scene.mesh, scene.fields, destinations, piece_bytes);
  scene.expect_sound();
}

TEST_P(Migration, ABalanceByCostSharesOutWhatOneRankHolds) {
  Scene scene(GetParam());
  migrate(world(), scene.mesh, scene.fields, std::vector<int>(scene.mesh.element_ids.size(), 0));
  const BalanceReport report = balance_by_cost(world(), scene.mesh, scene.fields, {}, false);
  scene.expect_sound();
  if (world().size() == 1) {
    EXPECT_EQ(report.migration.moved_elements, 0);
    return;
  }
  EXPECT_LT(report.cost_after, report.cost_before);
  EXPECT_GT(scene.mesh.elements(), 0);
  const auto largest = static_cast<Real>(world().max(static_cast<GlobalId>(scene.mesh.elements())));
  EXPECT_LE(largest * world().size(), 1.5 * static_cast<Real>(scene.mesh.total_elements));
  EXPECT_NE(describe_balance(report).find("instead of"), std::string::npos);
}

TEST_P(Migration, AllElementsMayGatherOnOneRankAndSpreadAgain) {
  Scene scene(GetParam());
  const int last = world().size() - 1;
  migrate(world(), scene.mesh, scene.fields, std::vector<int>(scene.mesh.element_ids.size(), last));
  EXPECT_EQ(scene.mesh.elements(), world().rank() == last ? scene.mesh.total_elements : 0);
  scene.expect_sound();
  std::vector<int> spread;
  for (const GlobalId id : scene.mesh.element_ids)
    spread.push_back(static_cast<int>(id * world().size() / scene.mesh.total_elements));
  migrate(world(), scene.mesh, scene.fields, spread);
  scene.expect_sound();
}

TEST_P(Migration, RanksMayHoldOneElementOrNone) {
  Scene scene(GetParam());
  std::vector<int> plan;  // element r on rank r, all others on the last
  for (const GlobalId id : scene.mesh.element_ids)
    plan.push_back(static_cast<int>(std::min<GlobalId>(id, world().size() - 1)));
  migrate(world(), scene.mesh, scene.fields, plan);
  if (world().rank() + 1 < world().size()) {
    EXPECT_EQ(scene.mesh.elements(), 1);
  }
  scene.expect_sound();
  const BalanceReport report = balance_by_cost(world(), scene.mesh, scene.fields, {}, false);
  EXPECT_LE(report.cost_after, report.cost_before);
  scene.expect_sound();
}

TEST_P(Migration, ElementsOnOneRankAreDealtOutEvenly) {
  Scene scene(GetParam());
  migrate(world(), scene.mesh, scene.fields, std::vector<int>(scene.mesh.element_ids.size(), 0));
  balance_along_curve(world(), scene.mesh, scene.fields);
  scene.expect_sound();
  const Real mean = static_cast<Real>(scene.mesh.total_elements) / world().size();
  EXPECT_LE(scene.mesh.elements(), 1.2 * mean);
  EXPECT_EQ(balance_along_curve(world(), scene.mesh, scene.fields, 0.2).moved_elements, 0);
}

TEST_P(Migration, ReferencesToFieldsStayValid) {
  Scene scene(GetParam());
  const Field& velocity = scene.fields["velocity"];
  migrate(world(), scene.mesh, scene.fields, std::vector<int>(scene.mesh.element_ids.size(), 0));
  EXPECT_EQ(velocity.values().size(), scene.mesh.coordinates.size());
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Migration, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
