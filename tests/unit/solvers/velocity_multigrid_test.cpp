#include "solvers/multigrid/velocity_multigrid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "solvers/multigrid/galerkin.hpp"
#include "solvers/scalar_multigrid.hpp"
#include "solvers/stokes_blocks.hpp"
#include "support/stokes_cavity.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

MultigridLevel finest_of(const LinearSystem& system) {
  StokesBlocks blocks = extract_blocks(system);
  const Mesh& mesh = *system.mesh;
  MultigridLevel level;
  level.layout = blocks.layout;
  level.graph = blocks.graph;
  level.values = std::move(blocks.velocity);
  level.points.assign(mesh.coordinates.begin(),
                      mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(mesh.owned_nodes()) * mesh.dim);
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    level.left_out.push_back(system.constraints->fixed_directions(node) == mesh.dim);
  }
  return level;
}

/// Values that depend on the global number alone.
std::vector<Real> wave(const Mesh& mesh, Real frequency) {
  std::vector<Real> values;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    for (int d = 0; d < mesh.dim; ++d) {
      values.push_back(std::sin(frequency * static_cast<Real>(mesh.global_node(node) * 3 + d) + 0.1));
    }
  }
  return values;
}

Real dot(const std::vector<Real>& a, const std::vector<Real>& b) {
  return world().sum(std::inner_product(a.begin(), a.end(), b.begin(), 0.0));
}

test::CavityOptions scene_options(int dim) {
  test::CavityOptions options;
  options.box = {.dim = dim, .cells = {9, 8, 9}, .jitter = 0.2};
  if (dim == 2) options.box.cells = {30, 28, 1};
  options.spheres = test::spread_spheres(3, false);
  options.inside = 50;
  return options;
}

TEST(VelocityMultigrid, CycleIsSymmetricAndPositive) {
  for (const int dim : {2, 3}) {
    const test::StokesCavity scene(world(), scene_options(dim));
    for (const bool rigid : {false, true}) {
      MultigridSettings settings{.rigid_modes = rigid, .double_precision = true};
      settings.coarsest_unknowns = 40;  // so that several levels, and their gathering, take part
      settings.nodes_per_rank = 20;
      const auto multigrid =
          make_velocity_multigrid(world(), finest_of(scene.system()), *scene.system().constraints, settings);
      EXPECT_GE(multigrid->levels().size(), 3U);
      EXPECT_EQ(multigrid->levels().back().active_ranks, 1);
      const std::vector<Real> a = wave(scene.mesh(), 1.3);
      const std::vector<Real> b = wave(scene.mesh(), 0.7);
      std::vector<Real> ma(a.size());
      std::vector<Real> mb(a.size());
      multigrid->apply(a.data(), ma.data());
      multigrid->apply(b.data(), mb.data());
      EXPECT_NEAR(dot(ma, b) / dot(a, mb), 1, 1e-9);
      EXPECT_GT(dot(ma, a), 0);
      EXPECT_GT(dot(mb, b), 0);
    }
  }
}

/// Aggregates are strings across flattened elements; their weak neighbours must not make the coarse rows long.
TEST(VelocityMultigrid, FlattenedElementsKeepTheHierarchySmall) {
  for (const bool rigid : {false, true}) {
    test::CavityOptions options;
    options.box = {.dim = 3, .cells = {10, 10, 10}, .jitter = 0.2};
    options.aspect = 20;
    const test::StokesCavity scene(world(), options);
    const auto multigrid = make_velocity_multigrid(world(), finest_of(scene.system()), *scene.system().constraints,
                                                   {.rigid_modes = rigid});
    EXPECT_LT(multigrid->operator_complexity(), rigid ? 2.6 : 1.4);
    EXPECT_GE(multigrid->levels().size(), 2U);
  }
}

/// On a free body the coarse operator must not feel rigid motions: P reproduces them and A has none of their energy.
TEST(VelocityMultigrid, RigidMotionsHaveNoEnergyOnCoarseLevels) {
  for (const int dim : {2, 3}) {
    test::CavityOptions options = scene_options(dim);
    options.is_floating = true;
    const test::StokesCavity scene(world(), options);
    MultigridLevel fine = finest_of(scene.system());
    invert_diagonals(fine);
    estimate_largest_eigenvalue(world(), fine);
    const Aggregates aggregates = aggregate(fine.layout, fine.graph, fine.values, dim, 0.15, fine.left_out);
    const Ownership ownership(world(), aggregates.count);
    CoarseSpace space =
        make_coarse_space(world(), fine, aggregates, ownership, {dim, true}, scene.system().constraints);
    MultigridLevel coarse;
    make_coarse_operator(world(), fine, space.prolongator, coarse);
    const int modes = coarse_modes(dim, true);
    std::vector<Real> motion(static_cast<std::size_t>(coarse.layout.size()) * modes, 0.0);
    Real largest = 0;
    for (LocalId node = 0; node < coarse.layout.owned(); ++node) {
      Real* m = motion.data() + static_cast<std::size_t>(node) * modes;
      const Real* x = space.points.data() + static_cast<std::size_t>(node) * dim;
      m[0] = 1 - x[1];  // a rotation of rate 1 about the last axis and a translation
      m[1] = x[0];
      m[modes - 1] = space.scale;
    }
    coarse.layout.halo.update_copies(std::span(motion), modes);
    Real energy = 0;
    for (LocalId row = 0; row < coarse.graph.rows(); ++row) {
      const auto r = static_cast<std::size_t>(row);
      for (LocalId k = coarse.graph.offsets[r]; k < coarse.graph.offsets[r + 1]; ++k) {
        const Real* block = coarse.values.at(k);
        const auto column = static_cast<std::size_t>(coarse.graph.columns[static_cast<std::size_t>(k)]);
        for (int i = 0; i < modes; ++i) {
          for (int j = 0; j < modes; ++j) {
            energy += motion[r * modes + static_cast<std::size_t>(i)] * block[j * modes + i] *
                      motion[column * modes + static_cast<std::size_t>(j)];
          }
          largest = std::max(largest, std::abs(block[i * modes + i]));
        }
      }
    }
    const Real nodes = static_cast<Real>(coarse.layout.ownership.total());
    EXPECT_LT(std::abs(world().sum(energy)) / (world().max(largest) * nodes), 1e-13);
  }
}

/// Nodes that nothing couples to others, as those of elements that are not modelled, stay off the coarse levels.
TEST(ScalarMultigrid, NodesThatAreAloneDoNotStopTheCoarsening) {
  const test::StokesCavity scene(world(), scene_options(2));
  const StokesBlocks blocks = extract_blocks(scene.system());
  std::vector<float> places(static_cast<std::size_t>(blocks.layout.size()));
  for (LocalId row = 0; row < blocks.graph.rows(); ++row) {
    places[static_cast<std::size_t>(row)] = static_cast<float>(scene.mesh().point(row)[0]);
  }
  blocks.layout.halo.update_copies(std::span(places), 1);
  const auto is_alone = [&](LocalId local) { return places[static_cast<std::size_t>(local)] > 0.3F; };
  std::vector<Real> values(static_cast<std::size_t>(blocks.graph.entries()), 0.0);
  for (LocalId row = 0; row < blocks.graph.rows(); ++row) {
    const auto r = static_cast<std::size_t>(row);
    const auto diagonal = static_cast<std::size_t>(blocks.graph.diagonals[r]);
    values[diagonal] = 1;
    for (LocalId k = blocks.graph.offsets[r]; k < blocks.graph.offsets[r + 1]; ++k) {
      const LocalId column = blocks.graph.columns[static_cast<std::size_t>(k)];
      if (column == row || is_alone(row) || is_alone(column)) continue;
      values[static_cast<std::size_t>(k)] = -1;
      values[diagonal] += 1;
    }
  }
  const ScalarMatrix matrix{world(), blocks.layout, blocks.graph, values};
  const auto multigrid = make_scalar_multigrid(matrix);
  ASSERT_GE(multigrid->levels().size(), 2U);
  EXPECT_LT(3 * multigrid->levels()[1].nodes, multigrid->levels()[0].nodes);
  std::vector<Real> one(static_cast<std::size_t>(blocks.graph.rows()), 1.0);
  std::vector<Real> corrected = one;
  multigrid->apply(one.data(), corrected.data());
  for (LocalId row = 0; row < blocks.graph.rows(); ++row) {
    if (!is_alone(row)) continue;
    EXPECT_NEAR(corrected[static_cast<std::size_t>(row)], 1, 1e-6);
  }
}

TEST(Aggregation, EveryFreeNodeHasOneAggregate) {
  const test::StokesCavity scene(world(), scene_options(3));
  const MultigridLevel level = finest_of(scene.system());
  const Aggregates aggregates = aggregate(level.layout, level.graph, level.values, 3, 0.15, level.left_out);
  std::vector<int> sizes(static_cast<std::size_t>(aggregates.count), 0);
  for (LocalId node = 0; node < level.graph.rows(); ++node) {
    const LocalId a = aggregates.of_node[static_cast<std::size_t>(node)];
    EXPECT_EQ(a < 0, level.left_out[static_cast<std::size_t>(node)]);
    if (a >= 0) ++sizes[static_cast<std::size_t>(a)];
  }
  for (const int size : sizes) EXPECT_GT(size, 0);
}

/// A penalty on the diagonal, as of contact, must not part a node from its neighbours.
TEST(Aggregation, PenaltyOnTheDiagonalChangesNothing) {
  const test::StokesCavity scene(world(), scene_options(3));
  MultigridLevel level = finest_of(scene.system());
  const Aggregates before = aggregate(level.layout, level.graph, level.values, 3, 0.15, level.left_out);
  for (LocalId node = 0; node < level.graph.rows(); node += 3) {
    level.values.at(level.graph.diagonals[static_cast<std::size_t>(node)])[0] += 1e6;
  }
  EXPECT_EQ(aggregate(level.layout, level.graph, level.values, 3, 0.15, level.left_out).of_node, before.of_node);
}

}  // namespace
}  // namespace malleus
