/// Elements that are not modelled, and the pressures in them.

#include <gtest/gtest.h>

#include <cmath>

#include "fem/boundary_conditions.hpp"
#include "solvers/newton.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;
using Velocity = std::array<std::optional<Expression>, 3>;

/// 1 Pa.s, none inside a sphere.
class Hollow final : public ViscosityModel {
 public:
  static bool is_void(const Mesh& mesh, LocalId element) {
    Real square = 0;
    for (int d = 0; d < mesh.dim; ++d) {
      Real x = -0.5;
      for (const LocalId node : mesh.nodes_of_element(element)) x += mesh.point(node)[d] / (mesh.dim + 1);
      square += x * x;
    }
    return square < 0.3 * 0.3;
  }
  void evaluate(const Mesh& mesh, std::span<const Real> /*rate*/, std::span<Real> viscosity,
                std::span<Real> slope) const override {
    std::fill(slope.begin(), slope.end(), 0);
    for (LocalId e = 0; e < mesh.elements(); ++e) viscosity[static_cast<std::size_t>(e)] = is_void(mesh, e) ? 0 : 1;
  }
  Real sensitivity() const override { return 1; }
  bool is_linear() const override { return true; }
};

/// A box of fluid about a pocket; all sides are held, x_high at a velocity.
class AroundAPocket {
 public:
  AroundAPocket(int dim, Geometry geometry)
      : mesh_(test::box_mesh(world(), {.dim = dim, .cells = {8, 8, dim == 3 ? 8 : 1}, .jitter = 0.15})),
        geometry_(geometry),
        op_(world(), mesh_, geometry) {
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      if (Hollow::is_void(mesh_, e)) pocket_.push_back(e);
    }
    op_.set_viscosity(model_);
    state_.borders.assign(1, 0);
  }

  /// x_high: velocity there. Solves with a gate for the pocket, or with a pressure in it; is_open: y_high is free.
  void solve(const Velocity& x_high, const std::optional<FluxGate>& gate, Real pressure, bool is_open = false) {
    std::vector<BoundaryCondition> conditions;
    for (const char* name : {"x_low", "x_high", "y_low", "y_high", "z_low", "z_high"}) {
      if ((mesh_.dim == 2 && name[0] == 'z') || (is_open && name == std::string("y_high"))) continue;
      BoundaryCondition& side = conditions.emplace_back();
      side.group = mesh_.find_group(name);
      if (name != std::string("x_high")) continue;
      side.kind = ConditionKind::velocity;
      for (std::size_t c = 0; c < 3; ++c) side.velocity[c] = x_high[c].value_or(Expression(0));
    }
    op_.set_constraints(make_constraints(world(), mesh_, geometry_, conditions, 0));
    StokesLoads loads;
    loads.void_pressure.assign(static_cast<std::size_t>(mesh_.elements()), 0);
    for (const LocalId e : pocket_) loads.void_pressure[static_cast<std::size_t>(e)] = pressure;
    op_.set_loads(std::move(loads));
    std::vector<FluxGate> gates;
    if (gate) gates.push_back(*gate);
    op_.set_gates(gates);
    op_.prepare();
    state_ = op_.start_state();
    StokesLinearSolver linear;
    const NewtonOutcome outcome =
        NewtonSolver({.tolerance = 1e-9, .linear_tolerance = 1e-9}).solve(op_, linear, state_);
    EXPECT_TRUE(outcome.converged) << outcome.reason;
  }

  FluxGate gate() const {
    FluxGate gate;
    gate.voids = pocket_;
    return gate;
  }
  /// Out of the fluid, into the pocket: - integral of div v.
  Real flow_into_pocket() const {
    Real flow = 0;
    with_dim(mesh_.dim, [&](auto d) {
      constexpr int D = decltype(d)::value;
      for (const LocalId e : pocket_) {
        const auto shape = p1_gradients<D>(simplex_points<D>(mesh_, e));
        const auto nodes = mesh_.nodes_of_element(e);
        for (int a = 0; a <= D; ++a) {
          const Real* v = state_.nodes.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * (D + 1);
          for (int k = 0; k < D; ++k) flow -= shape.volume * shape.gradients(k, a) * v[k];
        }
      }
    });
    return world().sum(flow);
  }
  /// Largest difference of the pressures at the fluid's nodes from a value.
  Real pressure_error(Real value) const {
    Real error = 0;
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      if (Hollow::is_void(mesh_, e)) continue;
      for (const LocalId node : mesh_.nodes_of_element(e)) {
        const auto size = static_cast<std::size_t>(mesh_.dim) + 1;
        error = std::max(error, std::abs(state_.nodes[static_cast<std::size_t>(node) * size + size - 1] - value));
      }
    }
    return world().max(error);
  }
  Real fastest() const {
    Real speed = 0;
    const auto size = static_cast<std::size_t>(mesh_.dim) + 1;
    for (std::size_t i = 0; i < state_.nodes.size(); ++i) {
      if (i % size != size - 1) speed = std::max(speed, std::abs(state_.nodes[i]));
    }
    return world().max(speed);
  }
  const StokesState& state() const { return state_; }
  const StokesOperator& op() const { return op_; }

 private:
  Mesh mesh_;
  Geometry geometry_;
  Hollow model_;
  StokesOperator op_;
  std::vector<LocalId> pocket_;
  StokesState state_;
};

const std::vector<std::pair<int, Geometry>> scenes = {
    {2, Geometry::plane}, {2, Geometry::axisymmetric}, {3, Geometry::plane}};

TEST(Void, ItsPressureIsThatOfTheFluidAtRest) {
  for (const auto& [dim, geometry] : scenes) {
    AroundAPocket scene(dim, geometry);
    scene.solve({}, std::nullopt, 7);
    EXPECT_FALSE(scene.op().pressure_is_free());
    EXPECT_LT(scene.pressure_error(7), 1e-5);
    EXPECT_LT(scene.fastest(), 1e-6);
  }
}

TEST(Void, AClosedPocketKeepsItsVolume) {
  for (const auto& [dim, geometry] : scenes) {
    if (geometry == Geometry::axisymmetric) continue;
    AroundAPocket scene(dim, geometry);
    Velocity lid;
    lid[1] = Expression::parse("sin(pi*y)");
    scene.solve(lid, std::nullopt, 0, true);
    const Real yields = std::abs(scene.flow_into_pocket());
    scene.solve(lid, scene.gate(), 0, true);
    EXPECT_LT(std::abs(scene.flow_into_pocket()), 1e-7);
    EXPECT_GT(yields, 1e-4);
  }
}

/// What comes in through x_high can only go where the gas gives way.
TEST(Void, GasTakesInWhatItsComplianceLets) {
  for (const auto& [dim, geometry] : scenes) {
    AroundAPocket scene(dim, geometry);
    Velocity inflow;
    inflow[0] = Expression::parse(dim == 3 ? "-y*(1-y)*z*(1-z)" : "-y*(1-y)");
    FluxGate gas = scene.gate();
    gas.compliance = 0.2;
    gas.reference = 3;
    scene.solve(inflow, gas, 0);
    EXPECT_FALSE(scene.op().pressure_is_free());
    if (geometry == Geometry::plane) {
      const Real flow = scene.flow_into_pocket();
      EXPECT_GT(flow, 0.02);
      EXPECT_NEAR(scene.state().borders[0], 3 + flow / 0.2, 1e-6);
    } else {
      EXPECT_GT(scene.state().borders[0], 3 + 0.9 / 0.2);  // 2 pi times the mean of 1/6, less what facets cut off
    }
  }
}

}  // namespace
}  // namespace malleus
