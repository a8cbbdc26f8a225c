#include "solvers/newton.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

/// Upsetting of the unit box along `axis`, frictionless: top at speed -1, three planes of symmetry.
NodeConstraints upsetting(const Mesh& mesh, int axis) {
  NodeConstraints constraints(mesh.dim, mesh.nodes());
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    for (int d = 0; d < mesh.dim; ++d) {
      const Real x = mesh.point(node)[d];
      std::array<Real, 3> direction{};
      std::array<Real, 3> velocity{};
      direction[static_cast<std::size_t>(d)] = 1;
      if (x < 1e-9) constraints.fix_direction(node, direction.data(), velocity.data());
      velocity[static_cast<std::size_t>(d)] = -1;
      if (d == axis && x > 1 - 1e-9) constraints.fix_direction(node, direction.data(), velocity.data());
    }
  }
  return constraints;
}

struct Upset {
  NewtonOutcome outcome;
  Real force = 0;
  Real velocity_error = 0;
};

Upset upset(int dim, int axis, Real sensitivity) {
  const Mesh mesh = box_mesh(world(), {.dim = dim, .cells = {4, 5, dim == 3 ? 3 : 1}, .jitter = 0.2});
  std::vector<std::unique_ptr<const ViscousLaw>> laws;
  const Real rate = 1;
  laws.push_back(std::make_unique<NortonHoffLaw>(NortonHoff{2.0, sensitivity, 1e-6 * rate}));
  const RegionViscosity model(std::move(laws));
  StokesOperator op(world(), mesh, Geometry::plane);
  op.set_viscosity(model);
  op.set_constraints(upsetting(mesh, axis));
  op.prepare();
  StokesState state = op.start_state();
  StokesLinearSolver linear;
  Upset result;
  result.outcome =
      NewtonSolver({.tolerance = 1e-8, .linear_tolerance = 1e-10, .start_shear_rate = rate}).solve(op, linear, state);
  const std::vector<Real> reactions = op.reactions(state);
  Real force = 0;
  Real error = 0;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    const Real* v = state.nodes.data() + static_cast<std::size_t>(node) * (dim + 1);
    const Real* x = mesh.point(node);
    if (x[axis] > 1 - 1e-9) force -= reactions[static_cast<std::size_t>(node * dim + axis)];
    for (int d = 0; d < dim; ++d) error = std::max(error, std::abs(v[d] - (d == axis ? -x[d] : x[d] / (dim - 1))));
  }
  result.force = world().sum(force);
  result.velocity_error = world().max(error);
  return result;
}

TEST(Newton, FrictionlessUpsettingIsExact) {
  for (const int dim : {2, 3}) {
    for (int axis = 0; axis < dim; ++axis) {
      for (const Real m : {1.0, 0.5, 0.3, 0.1}) {
        const Upset result = upset(dim, axis, m);
        SCOPED_TRACE(testing::Message() << "dim " << dim << " axis " << axis << " m " << m);
        ASSERT_TRUE(result.outcome.converged) << result.outcome.reason;
        EXPECT_LE(result.outcome.iterations(), m == 1 ? 1 : 15);
        // 3D: sqrt(3) K (sqrt(3) V/H)^m. Plane strain: gamma = 2 V/H, stress = 2 eta (V/H) 2 = 2 K gamma^m.
        const Real exact = dim == 3 ? std::sqrt(3.0) * 2 * std::pow(std::sqrt(3.0), m) : 2 * 2 * std::pow(2.0, m);
        EXPECT_NEAR(result.force / exact, 1, 1e-7);
        EXPECT_LT(result.velocity_error, 1e-7);
      }
    }
  }
}

}  // namespace
}  // namespace malleus
