#include "forge/tool.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace malleus::forge {
namespace {

Press at_speed(Real speed) {
  return Press({.kind = PressKind::speed, .speed = [speed](Real) { return speed; }});
}

TEST(Tool, PlaneMovesAlongItsDirection) {
  Tool tool("ram", make_plane({0, 0, 1}, {0, 0, -1}), {.direction = {0, 0, -1}}, at_speed(0.2), {});
  tool.plan(0, euler_step(0.5));
  EXPECT_NEAR(tool.distance_at_end({0, 0, 0.5}), 0.4, 1e-15);
  EXPECT_EQ(tool.velocity_at({3, 4, 5}), Vector(0, 0, -0.2));
  EXPECT_NEAR(tool.resistance({1, 2, 30}), 30, 1e-15);
  tool.press().commit(0, 0, euler_step(0.5));
  tool.plan(0.5, euler_step(0.5));
  EXPECT_NEAR(tool.distance_at_end({0, 0, 0.5}), 0.3, 1e-15);
  std::vector<SurfaceContact> contacts;
  tool.contacts_at_start({0, 0, 0.5}, 1, contacts);
  ASSERT_EQ(contacts.size(), 1U);
  EXPECT_NEAR(contacts[0].distance, 0.4, 1e-15);
}

TEST(Tool, RollTurnsAboutItsAxis) {
  Tool roll("roll", make_box({1, 0, 0}, {2, 2, 0}, Side::outside), {.rotation = {0, 0, std::numbers::pi / 2}},
            at_speed(0), {});
  roll.plan(0, euler_step(1));  // a quarter turn: the box now lies along +y
  EXPECT_NEAR(roll.distance_at_end({0, 3, 0}), 1, 1e-12);
  std::vector<SurfaceContact> contacts;
  roll.contacts_at_end({0, 3, 0}, 2, contacts);
  ASSERT_EQ(contacts.size(), 1U);
  EXPECT_NEAR((contacts[0].normal - Vector(0, 1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((roll.velocity_at({2, 0, 0}) - Vector(0, std::numbers::pi, 0)).norm(), 0, 1e-12);
  EXPECT_TRUE(roll.moves());
}

}  // namespace
}  // namespace malleus::forge
