#include "mesh/verify.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "base/error.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

Mesh sound_mesh(int dim) {
  test::BoxMeshOptions box;
  box.dim = dim;
  box.cells = {5, 4, 3};
  return box_mesh(world(), box);
}

/// Whether the promise that begins so is broken after a change made on the highest rank that has elements.
bool breaks(int dim, const std::string& promise, const std::function<void(Mesh&)>& change) {
  Mesh mesh = sound_mesh(dim);
  const GlobalId last = world().max(mesh.elements() > 0 ? static_cast<GlobalId>(world().rank()) : GlobalId{-1});
  if (world().rank() == last) change(mesh);
  const std::vector<std::string> broken = broken_promises(world(), mesh);
  return std::any_of(broken.begin(), broken.end(), [&](const std::string& text) { return text.starts_with(promise); });
}

class Verification : public testing::TestWithParam<int> {};

TEST_P(Verification, ASoundMeshBreaksNoPromise) {
  EXPECT_EQ(broken_promises(world(), sound_mesh(GetParam())), std::vector<std::string>{});
  EXPECT_NO_THROW(verify_mesh(world(), sound_mesh(GetParam())));
}

TEST_P(Verification, EachBrokenPromiseIsFound) {
  const int dim = GetParam();
  EXPECT_TRUE(breaks(dim, "the lists of the mesh fit", [](Mesh& mesh) { mesh.element_ids.pop_back(); }));
  EXPECT_TRUE(breaks(dim, "indices are within", [](Mesh& mesh) { mesh.facet_group[0] = 99; }));
  EXPECT_TRUE(breaks(dim, "the total of elements", [](Mesh& mesh) { mesh.total_elements += 1; }));
  EXPECT_TRUE(breaks(dim, "every element has a positive",
                     [](Mesh& mesh) { std::swap(mesh.element_nodes[0], mesh.element_nodes[1]); }));
  EXPECT_TRUE(breaks(dim, "every node belongs", [](Mesh& mesh) {
    std::fill(mesh.element_nodes.begin(), mesh.element_nodes.end(), mesh.element_nodes[0]);
  }));
  EXPECT_TRUE(
      breaks(dim, "a facet is a face", [](Mesh& mesh) { std::swap(mesh.facet_nodes[0], mesh.facet_nodes[1]); }));
  EXPECT_TRUE(breaks(dim, "a face belongs to at most two", [](Mesh& mesh) {
    const auto n = static_cast<std::ptrdiff_t>(mesh.dim) + 1;
    std::copy_n(mesh.element_nodes.begin(), n, mesh.element_nodes.begin() + n);
    std::copy_n(mesh.element_nodes.begin(), n, mesh.element_nodes.begin() + 2 * n);
  }));
}

TEST_P(Verification, FacetsThatAreMissingOrListedTwiceAreFound) {
  const int dim = GetParam();
  EXPECT_TRUE(breaks(dim, "the exterior facets", [](Mesh& mesh) {
    mesh.facet_nodes.resize(mesh.facet_nodes.size() - static_cast<std::size_t>(mesh.dim));
    mesh.facet_element.pop_back();
    mesh.facet_group.pop_back();
    --mesh.exterior_facets;
  }));
  const auto repeat_first = [](Mesh& mesh) {
    for (int k = 0; k < mesh.dim; ++k) mesh.facet_nodes.push_back(mesh.facet_nodes[static_cast<std::size_t>(k)]);
    mesh.facet_element.push_back(mesh.facet_element[0]);
    mesh.facet_group.push_back(0);
  };
  EXPECT_TRUE(breaks(dim, "a facet is listed once", repeat_first));
  EXPECT_TRUE(breaks(dim, "further facets are inner", repeat_first));
}

TEST_P(Verification, DisagreementBetweenRanksIsFound) {
  if (world().size() == 1) return;
  const int dim = GetParam();
  EXPECT_TRUE(breaks(dim, "dimension and names", [](Mesh& mesh) { mesh.group_names[0] = "other"; }));
  EXPECT_TRUE(breaks(dim, "copies have their owner's", [](Mesh& mesh) { mesh.point(mesh.nodes() - 1)[0] += 1e-9; }));
  EXPECT_TRUE(breaks(dim, "copies are sorted", [](Mesh& mesh) { mesh.copy_numbers[0] = mesh.copy_numbers[1]; }));
}

TEST(Verification, VerifyThrowsADefect) {
  Mesh mesh = sound_mesh(3);
  mesh.total_elements = 7;
  EXPECT_THROW(verify_mesh(world(), mesh), Defect);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Verification, testing::Values(2, 3));

}  // namespace
}  // namespace malleus
