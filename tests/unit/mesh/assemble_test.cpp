#include "mesh/assemble.hpp"

#include <gtest/gtest.h>

#include <set>

#include "base/error.hpp"
#include "mesh/node_owners.hpp"
#include "mesh/simplex.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::box_piece;
using test::BoxMeshOptions;
using test::world;

Real total_volume(const Mesh& mesh) {
  Real volume = 0;
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const Real mine = simplex_volume<D>(simplex_points<D>(mesh, e));
      EXPECT_GT(mine, 0);
      volume += mine;
    }
  });
  return world().sum(volume);
}

class AssembledBox : public testing::TestWithParam<int> {
 protected:
  BoxMeshOptions options() const {
    BoxMeshOptions box;
    box.dim = GetParam();
    box.cells = {5, 4, 3};
    return box;
  }
};

TEST_P(AssembledBox, CountsNodesElementsAndFacetsOnce) {
  const Mesh mesh = box_mesh(world(), options());
  EXPECT_EQ(mesh.total_nodes(), mesh.dim == 3 ? 6 * 5 * 4 : 6 * 5);
  EXPECT_EQ(mesh.total_elements, mesh.dim == 3 ? 5 * 4 * 3 * 6 : 5 * 4 * 2);
  EXPECT_EQ(world().sum(static_cast<GlobalId>(mesh.exterior_facets)), mesh.dim == 3 ? 4 * (20 + 15 + 12) : 18);
  EXPECT_EQ(mesh.facets(), mesh.exterior_facets);
  EXPECT_NEAR(total_volume(mesh), 1.0, 1e-14);
}

TEST_P(AssembledBox, GroupsCoverTheirSides) {
  const Mesh mesh = box_mesh(world(), options());
  GlobalId named = 0;
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    ASSERT_GE(mesh.facet_group[f], 0);
    const int axis = mesh.facet_group[f] / 2;
    const Real side = mesh.facet_group[f] % 2;
    for (const LocalId node : mesh.nodes_of_facet(f)) EXPECT_EQ(mesh.point(node)[axis], side);
    ++named;
  }
  EXPECT_EQ(world().sum(named), mesh.dim == 3 ? 188 : 18);
}

TEST_P(AssembledBox, CopiesAgreeWithTheirOwners) {
  Mesh mesh = box_mesh(world(), options());
  const std::vector<Real> before = mesh.coordinates;
  mesh.node_halo.update_copies(mesh.coordinates, mesh.dim);
  EXPECT_EQ(mesh.coordinates, before);
}

TEST_P(AssembledBox, FacetNormalsPointOutward) {
  const Mesh mesh = box_mesh(world(), options());
  if (mesh.dim != 2) return;
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    const auto nodes = mesh.nodes_of_facet(f);
    const Real dx = mesh.point(nodes[1])[0] - mesh.point(nodes[0])[0];
    const Real dy = mesh.point(nodes[1])[1] - mesh.point(nodes[0])[1];
    const int axis = mesh.facet_group[f] / 2;
    const Real normal = axis == 0 ? dy : -dx;
    EXPECT_GT(normal * (mesh.facet_group[f] % 2 == 1 ? 1 : -1), 0);
  }
}

TEST_P(AssembledBox, InvertedElementsAreTurned) {
  MeshPiece piece = box_piece(world(), options());
  const auto n = static_cast<std::size_t>(piece.dim) + 1;
  for (std::size_t e = 0; e < piece.element_region.size(); e += 2) {
    std::swap(piece.element_nodes[e * n], piece.element_nodes[e * n + 1]);
  }
  EXPECT_NEAR(total_volume(assemble_mesh(world(), piece).mesh), 1.0, 1e-14);
}

TEST_P(AssembledBox, AnInnerFacetWithAGroupIsListedOnceOverAllRanks) {
  MeshPiece piece = box_piece(world(), options());
  const auto dim = static_cast<std::size_t>(piece.dim);
  piece.group_names.push_back("middle");
  const auto group = static_cast<std::int32_t>(piece.group_names.size()) - 1;
  const auto is_middle = [&](LocalId node) { return std::abs(piece.coordinates[node * dim] - 0.4) < 1e-12; };
  for (std::size_t e = 0; e < piece.element_region.size(); ++e) {
    std::vector<LocalId> inside;
    for (std::size_t i = 0; i <= dim; ++i) {
      const LocalId node = piece.element_nodes[e * (dim + 1) + i];
      if (is_middle(node)) inside.push_back(node);
    }
    if (inside.size() != dim) continue;
    piece.facet_nodes.insert(piece.facet_nodes.end(), inside.begin(), inside.end());
    piece.facet_group.push_back(group);
  }
  const Mesh mesh = assemble_mesh(world(), piece).mesh;
  EXPECT_EQ(world().sum(static_cast<GlobalId>(mesh.facets() - mesh.exterior_facets)), mesh.dim == 3 ? 24 : 4);
}

TEST_P(AssembledBox, MoreRanksThanCellsLeavesEmptyRanks) {
  BoxMeshOptions box = options();
  box.cells = {1, 1, 1};
  const Mesh mesh = box_mesh(world(), box);
  EXPECT_EQ(mesh.total_nodes(), mesh.dim == 3 ? 8 : 4);
  EXPECT_NEAR(total_volume(mesh), 1.0, 1e-14);
}

/// Cubes side by side, a slab each: nodes between two ranks are not all the lower one's.
TEST_P(AssembledBox, NodesBetweenRanksAreSharedOut) {
  BoxMeshOptions box = options();
  box.cells = {12, 6, 6};
  const Mesh mesh = box_mesh(world(), box);
  const Real load = static_cast<Real>(mesh.owned_nodes()) + static_cast<Real>(mesh.elements()) / node_work_in_elements;
  const Real mean = world().sum(load) / world().size();
  EXPECT_LE(world().max(load), 1.03 * mean + 1);
  GlobalId elsewhere = 0;  // copies whose owner is a higher rank
  for (const GlobalId number : mesh.copy_numbers) elsewhere += mesh.node_ownership.owner_of(number) > world().rank();
  if (world().size() > 1) {
    EXPECT_GT(world().sum(elsewhere), 0);
  }
}

TEST_P(AssembledBox, AFaceOfThreeElementsIsRefused) {
  MeshPiece piece = box_piece(world(), options());
  const auto n = static_cast<std::size_t>(piece.dim) + 1;
  for (int copy = 0; copy < (world().is_root() ? 2 : 0); ++copy) {
    piece.element_nodes.insert(piece.element_nodes.end(), piece.element_nodes.begin(), piece.element_nodes.begin() + n);
    piece.element_region.push_back(0);
    piece.element_ids.push_back(-1);
  }
  try {
    assemble_mesh(world(), piece);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::wrong_input);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, AssembledBox, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
