#include <gtest/gtest.h>

#include "level_set_cases.hpp"

namespace malleus {
namespace {

using test::world;

constexpr Real disc_area = std::numbers::pi * 0.15 * 0.15;
constexpr Sphere disc = {{0.5, 0.75, 0}, 0.15};

/// Relative to the disc's area.
struct VortexErrors {
  Real misplaced, volume;
};

/// At 4 s, the worst moment. The full reversal is no test: schemes that are symmetric in time undo their own error.
VortexErrors vortex_at_its_worst(const Mesh& mesh, Stabilization kind) {
  const NodeGraph graph = build_node_graph(mesh);
  auto level_set = test::at_nodes(mesh, [](const Position& x) { return signed_distance(disc, x); });
  LevelSetTransport transport(world(), mesh, graph, {kind, 0.5, 1e-5, 0});
  constexpr int steps = 256;
  for (int s = 0; s < steps; ++s) {
    const auto velocity = test::velocity_at_nodes(mesh, test::vortex, (s + 0.5) * 4.0 / steps);
    EXPECT_TRUE(transport.advance(velocity, level_set, 4.0 / steps, {}).converged);
  }
  const Real misplaced = test::misplaced_area(mesh, level_set, [](const Position& x) {
    return signed_distance(disc, test::trace_back(test::vortex, x, 4, 48)) > 0;
  });
  return {misplaced / disc_area,
          positive_volume(world(), mesh, element_measures(mesh, false), level_set) / disc_area - 1};
}

// Published for these schemes on unstructured triangles of edge 1/64: 18 % misplaced and -3.9 % of volume with the
// transient tau, 24 % and -12 % with the residual-free bubbles'. 70 cells have as many nodes as that mesh.
TEST(Vortex, TheTransientStabilizationKeepsTheFilament) {
  const Mesh mesh = test::box_mesh(world(), {2, {70, 70, 1}, {0, 0, 0}, {1, 1, 0}, 0.15});
  const VortexErrors transient = vortex_at_its_worst(mesh, Stabilization::transient);
  EXPECT_LT(transient.misplaced, 0.20);
  EXPECT_GT(transient.misplaced, 0.10);
  EXPECT_LT(std::abs(transient.volume), 0.04);
  const VortexErrors bubbles = vortex_at_its_worst(mesh, Stabilization::residual_free_bubbles);
  EXPECT_GT(bubbles.misplaced, transient.misplaced);
  EXPECT_LT(bubbles.misplaced, 0.30);
  EXPECT_LT(std::abs(bubbles.volume), 0.20);
}

}  // namespace
}  // namespace malleus
