#pragma once

/// A rigid tool: shape, motion, friction. It has no unknowns.

#include <memory>
#include <string>
#include <vector>

#include "forge/friction.hpp"
#include "forge/press.hpp"
#include "forge/tool_shape.hpp"

namespace malleus::forge {

/// Where a tool stands: its own frame turned about `pivot`, then shifted.
struct Pose {
  Matrix turn = Matrix::Identity();
  Vector pivot = Vector::Zero();  ///< m
  Vector shift = Vector::Zero();  ///< m

  Vector to_tool(const Vector& point) const { return turn.transpose() * (point - shift - pivot) + pivot; }
  Vector to_space(const Vector& point) const { return turn * (point - pivot) + pivot + shift; }
};

struct ToolMotion {
  Vector direction = Vector::Zero();  ///< unit; along it the press moves the tool. Zero: the tool does not advance
  Vector rotation = Vector::Zero();   ///< rad/s, about an axis through `pivot`, which moves with the tool
  Vector pivot = Vector::Zero();      ///< m
};

class Tool {
 public:
  Tool(std::string name, std::unique_ptr<ToolShape> shape, ToolMotion motion, Press press, FrictionSpec friction);

  const std::string& name() const noexcept { return name_; }
  const FrictionSpec& friction() const noexcept { return friction_; }
  Press& press() noexcept { return press_; }
  const Press& press() const noexcept { return press_; }
  const ToolMotion& motion() const noexcept { return motion_; }
  Real area(bool is_revolved) const { return shape_->area(is_revolved); }
  bool moves() const noexcept { return motion_.direction.squaredNorm() > 0 || motion_.rotation.squaredNorm() > 0; }

  /// Fixes the poses at the start and the end of the increment that starts at `time`, and the velocity at speed_time.
  void plan(Real time, const Displacement& displacement, Real speed_time);
  void plan(Real time, const Displacement& displacement) { plan(time, displacement, time); }
  const Pose& start() const noexcept { return start_; }
  const Pose& end() const noexcept { return end_; }

  /// Faces near a point of space, in the pose at the start (end) of the increment; normals in space.
  void contacts_at_start(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const;
  void contacts_at_end(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const;
  Real distance_at_end(const Vector& point) const;

  /// Velocity of the tool's material at a point, at the start of the increment [m/s].
  Vector velocity_at(const Vector& point) const;
  /// Resistance [N] that the press feels under the force `on_tool` [N]: its part against the direction of motion.
  Real resistance(const Vector& on_tool) const { return -on_tool.dot(motion_.direction); }
  Real nominal_speed() const;                     ///< that of the press at the start, m/s
  Real largest_speed(const Bounds& scene) const;  ///< of any of its points within the scene, m/s

 private:
  Pose pose(Real time, Real stroke) const;

  std::string name_;
  std::unique_ptr<ToolShape> shape_;
  ToolMotion motion_;
  Press press_;
  FrictionSpec friction_;
  Pose start_;
  Pose end_;
  Real speed_ = 0;  ///< m/s along the direction, at the start of the increment
};

}  // namespace malleus::forge
