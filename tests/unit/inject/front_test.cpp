#include "inject/front.hpp"

#include <gtest/gtest.h>

#include "cavity.hpp"
#include "fem/level_set_volume.hpp"
#include "inject/filling.hpp"

namespace malleus::inject {
namespace {

using test::world;

/// A front in a plug flow of 1 m/s along x, in the box [0,2] x [0,1]^(dim-1).
struct PlugFlow {
  explicit PlugFlow(const InjectCase& settings, int dim)
      : scene(world(), test::box(dim, 16, 6), settings), fronts(scene) {
    state.gates.resize(1);
    state.gates[0].flow = 1;
    Field& velocity =
        scene.fields.declare(scene.mesh, {"velocity", "m/s", Support::node, dim, Transfer::interpolate, false});
    for (LocalId n = 0; n < scene.mesh.nodes(); ++n) velocity.at(n)[0] = 1;
  }
  Scene scene;
  FrontSet fronts;
  FillingState state;
};

TEST(Front, OfAPlugFlowStartsAtTheGateAndFillsWhatEnters) {
  for (const int dim : {2, 3}) {
    const InjectCase settings = test::box_case(dim, WallSettings::Condition::slip);
    PlugFlow plug(settings, dim);
    Front front(plug.scene, plug.fronts, plug.state, {});
    Filling filling(plug.scene, plug.fronts, plug.state);
    plug.fronts.set_initial();
    front.start();
    EXPECT_EQ(plug.state.initial, 0);
    Real time = 0;
    for (GlobalId n = 1; n <= 5; ++n) {
      const Increment increment{n, time += 0.3, 0.3};
      ASSERT_EQ(front.advance(increment).kind, Outcome::Kind::done);
      ASSERT_EQ(filling.advance(increment).kind, Outcome::Kind::done);
      EXPECT_NEAR(plug.state.filled, time, 1e-12);
      EXPECT_NEAR(plug.state.injected, time, 1e-12);
      EXPECT_NEAR(filling.volume_error(), 0, 1e-12);
      EXPECT_FALSE(filling.finished().has_value());
    }
    // The front is the plane x = t, and passed each node at t = x.
    const auto fill_time = plug.scene.fields["fill_time"].values();
    for (LocalId node = 0; node < plug.scene.mesh.nodes(); ++node) {
      const Real x = plug.scene.mesh.point(node)[0];
      EXPECT_NEAR(plug.fronts.values(0)[static_cast<std::size_t>(node)], time - x, 5e-3);
      const Real passed = fill_time[static_cast<std::size_t>(node)];
      if (x < time - 0.01) {
        EXPECT_NEAR(passed, x, 0.01);
      } else if (x > time + 0.01) {
        EXPECT_EQ(passed, -1);
      }
    }
  }
}

TEST(Front, ClosesTheVentAndLosesNothingThroughIt) {
  const InjectCase settings = test::box_case(2, WallSettings::Condition::slip);
  PlugFlow plug(settings, 2);
  Front front(plug.scene, plug.fronts, plug.state, {});
  Filling filling(plug.scene, plug.fronts, plug.state);
  plug.fronts.set_initial();
  front.start();
  EXPECT_TRUE(plug.fronts.has_way_out());
  const Increment increment{1, 1.9995, 1.9995};
  front.advance(increment);
  filling.advance(increment);
  EXPECT_NEAR(plug.state.filled, 1.9995, 1e-9);
  EXPECT_EQ(plug.state.left, 0);
  EXPECT_EQ(filling.finished(), "cavity full");
}

TEST(Front, RollsBack) {
  const InjectCase settings = test::box_case(2, WallSettings::Condition::slip);
  PlugFlow plug(settings, 2);
  Front front(plug.scene, plug.fronts, plug.state, {});
  plug.fronts.set_initial();
  front.start();
  front.advance({1, 0.4, 0.4});
  const auto values = plug.fronts.values(0);
  const std::vector<Real> before(values.begin(), values.end());
  front.advance({2, 0.9, 0.5});
  front.roll_back();
  EXPECT_EQ(before, std::vector<Real>(values.begin(), values.end()));
  EXPECT_NEAR(plug.state.injected, 0.4, 1e-12);
}

TEST(Front, StartsWithShapesAndKeepsTheirVolumeInAClosedFlow) {
  InjectCase settings = test::box_case(2, WallSettings::Condition::slip);
  settings.inlets.clear();
  settings.vents.clear();
  for (const char* group : {"x_low", "x_high"}) {
    WallSettings& wall = settings.walls.emplace_back();
    wall.name = wall.group = group;
    wall.condition = WallSettings::Condition::slip;
  }
  InitialShape& disc = settings.shapes.emplace_back();
  disc.fluid = "polymer";
  disc.shape = InitialShape::Shape::sphere;
  disc.center = {0.7, 0.5, 0};
  disc.radius = 0.3;
  PlugFlow plug(settings, 2);
  Field& velocity = plug.scene.fields["velocity"];
  for (LocalId n = 0; n < plug.scene.mesh.nodes(); ++n) {  // a vortex that fills the box
    const Real x = std::numbers::pi * plug.scene.mesh.point(n)[0] / 2,
               y = std::numbers::pi * plug.scene.mesh.point(n)[1];
    velocity.at(n)[0] = -std::sin(x) * std::cos(y);
    velocity.at(n)[1] = 0.5 * std::cos(x) * std::sin(y);
  }
  Front front(plug.scene, plug.fronts, plug.state, {});
  plug.fronts.set_initial();
  front.start();
  const Real volume = plug.state.initial;
  EXPECT_NEAR(volume, std::numbers::pi * 0.09, 0.02);
  front.advance({1, 0.5, 0.5});
  EXPECT_NEAR(positive_volume(world(), plug.scene.mesh, plug.scene.measures, plug.fronts.values(0)), volume, 1e-12);
}

}  // namespace
}  // namespace malleus::inject
