#include "inject/flow_conditions.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "cavity.hpp"
#include "inject/thin_sections.hpp"

namespace malleus::inject {
namespace {

using test::world;

FlowConditions conditions_of(const Scene& scene) {
  Mixture mixture(make_fluids(scene.settings, 1, 1e4), 1, MixtureLaw::fraction, 1);
  mixture.update(scene.mesh, {});
  const StickingNodes none(static_cast<std::size_t>(scene.mesh.nodes()), 0);
  return make_conditions(scene, mixture, asked_drives(scene, 0), none, 0);
}

/// Prescribed velocities at the nodes; zero where free.
std::vector<Real> imposed_velocity(const Scene& scene, const NodeConstraints& constraints) {
  const auto dim = static_cast<std::size_t>(scene.mesh.dim);
  std::vector<Real> velocity(static_cast<std::size_t>(scene.mesh.nodes()) * dim, 0);
  for (LocalId n = 0; n < scene.mesh.nodes(); ++n) {
    constraints.impose(n, velocity.data() + static_cast<std::size_t>(n) * dim);
  }
  return velocity;
}

TEST(VelocityInlet, IsRescaledToTheFlowAskedFor) {
  for (const int dim : {2, 3}) {
    InjectCase settings = test::box_case(dim, WallSettings::Condition::no_slip);
    settings.inlets[0].flow_rate.reset();
    settings.inlets[0].velocity_components[0] = Expression::parse("6*y*(1-y)");  // its mean is 1
    const Scene scene(world(), test::box(dim, 4, 3), settings);
    const FlowConditions conditions = conditions_of(scene);
    const auto velocity = imposed_velocity(scene, conditions.constraints);
    const auto inlets = scene.parts_of(BoundaryPart::Kind::inlet);
    EXPECT_NEAR(outflow(scene, inlets[0]->facets, velocity), -1, 1e-12);
    const auto vents = scene.parts_of(BoundaryPart::Kind::vent);
    EXPECT_NEAR(outflow(scene, vents[0]->facets, velocity), 0, 1e-14);
  }
}

TEST(Walls, WinOverInlets) {
  InjectCase settings = test::box_case(2, WallSettings::Condition::no_slip);
  settings.inlets[0].flow_rate.reset();
  settings.inlets[0].velocity = GateVelocity{Expression(3), {}};
  const Scene scene(world(), test::box(2, 4, 4), settings);
  const auto velocity = imposed_velocity(scene, conditions_of(scene).constraints);
  const auto inlets = scene.parts_of(BoundaryPart::Kind::inlet);
  EXPECT_NEAR(outflow(scene, inlets[0]->facets, velocity), -3, 1e-12);
  for (LocalId n = 0; n < scene.mesh.nodes(); ++n) {
    const Real* x = scene.mesh.point(n);
    const Real speed = velocity[static_cast<std::size_t>(n) * 2];
    const bool is_wall = x[1] < 1e-12 || x[1] > 1 - 1e-12;
    if (is_wall) {
      EXPECT_EQ(speed, 0);
    } else if (x[0] < 1e-12) {
      EXPECT_GT(speed, 3.5);  // the nodes off the walls carry the flow of all
    }
  }
}

TEST(FlowRateInlet, IsAGateWithoutTangentialVelocity) {
  InjectCase settings = test::box_case(3, WallSettings::Condition::slip);
  const Scene scene(world(), test::box(3, 3, 3), settings);
  const FlowConditions conditions = conditions_of(scene);
  ASSERT_EQ(conditions.gates.size(), 1u);
  EXPECT_EQ(conditions.gates[0].flux, -1);
  for (LocalId n = 0; n < scene.mesh.nodes(); ++n) {
    const Real* x = scene.mesh.point(n);
    std::array<Real, 3> velocity = {1, 1, 1};
    conditions.constraints.project(n, velocity.data());
    if (x[0] < 1e-12) {
      EXPECT_NEAR(velocity[0], 1, 1e-14);
      EXPECT_NEAR(velocity[1], 0, 1e-14);
      EXPECT_NEAR(velocity[2], 0, 1e-14);
    }
  }
}

TEST(Conditions, RefuseASealedCavityAndABlockedGate) {
  InjectCase sealed = test::box_case(2, WallSettings::Condition::no_slip);
  WallSettings& lid = sealed.walls.emplace_back();
  lid.name = "lid";
  lid.group = "x_high";
  sealed.vents.clear();
  const Scene closed(world(), test::box(2, 4, 4), sealed);
  EXPECT_THROW(conditions_of(closed), InputError);

  const InjectCase thin = test::box_case(2, WallSettings::Condition::no_slip);
  const Scene blocked(world(), test::box(2, 4, 1), thin);
  EXPECT_THROW(conditions_of(blocked), InputError);
}

TEST(Scene, RefusesABoundaryWithoutMeaningOrWithTwo) {
  InjectCase unnamed = test::box_case(2, WallSettings::Condition::slip);
  unnamed.walls.pop_back();
  EXPECT_THROW(Scene(world(), test::box(2, 4, 4), unnamed), InputError);
  InjectCase twice = test::box_case(2, WallSettings::Condition::slip);
  twice.vents[0].group = "x_low";
  EXPECT_THROW(Scene(world(), test::box(2, 4, 4), twice), InputError);
}

TEST(ThinSections, CountElementsBetweenWalls) {
  const InjectCase settings = test::box_case(2, WallSettings::Condition::no_slip);
  const auto thin_at = [&](int across) {
    return find_thin_sections(Scene(world(), test::box(2, 3 * across, across), settings));
  };
  EXPECT_GT(thin_at(1).below_two, 0.9);
  EXPECT_GT(thin_at(2).below_four, 0.9);
  EXPECT_EQ(thin_at(2).below_two, 0);
  EXPECT_GT(thin_at(3).below_four, 0.9);
  EXPECT_LT(thin_at(4).below_four, 0.05);
  EXPECT_EQ(thin_at(8).below_four, 0);
}

}  // namespace
}  // namespace malleus::inject
