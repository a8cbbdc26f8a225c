#include "forge/tool.hpp"

namespace malleus::forge {
namespace {

void contacts_in(const ToolShape& shape, const Pose& pose, const Vector& point, Real reach,
                 std::vector<SurfaceContact>& found) {
  const std::size_t before = found.size();
  shape.contacts(pose.to_tool(point), reach, found);
  for (std::size_t i = before; i < found.size(); ++i) found[i].normal = pose.turn * found[i].normal;
}

}  // namespace

Tool::Tool(std::string name, std::unique_ptr<ToolShape> shape, ToolMotion motion, Press press, FrictionSpec friction)
    : name_(std::move(name)),
      shape_(std::move(shape)),
      motion_(std::move(motion)),
      press_(std::move(press)),
      friction_(friction) {}

Pose Tool::pose(Real time, Real stroke) const {
  Pose pose;
  pose.pivot = motion_.pivot;
  pose.shift = stroke * motion_.direction;
  const Real rate = motion_.rotation.norm();
  if (rate > 0) pose.turn = Eigen::AngleAxisd(rate * time, motion_.rotation / rate).toRotationMatrix();
  return pose;
}

void Tool::plan(Real time, const Displacement& displacement, Real speed_time) {
  const bool advances = motion_.direction.squaredNorm() > 0;
  const Real stroke = press_.state().stroke;
  start_ = pose(time, stroke);
  end_ = pose(time + displacement.step, stroke + (advances ? press_.travel(time, displacement) : 0));
  speed_ = advances ? press_.speed(speed_time) : 0;
}

void Tool::contacts_at_start(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const {
  contacts_in(*shape_, start_, point, reach, found);
}

void Tool::contacts_at_end(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const {
  contacts_in(*shape_, end_, point, reach, found);
}

Real Tool::distance_at_end(const Vector& point) const {
  return shape_->nearest(end_.to_tool(point)).distance;
}

Vector Tool::velocity_at(const Vector& point) const {
  return speed_ * motion_.direction + motion_.rotation.cross(point - start_.pivot - start_.shift);
}

Real Tool::nominal_speed() const {
  if (!(motion_.direction.squaredNorm() > 0)) return 0;
  return std::abs(press_.speed(0));
}

Real Tool::largest_speed(const Bounds& scene) const {
  Real largest = velocity_at(start_.pivot + start_.shift).norm();
  for (int corner = 0; corner < 8; ++corner) {
    const Vector point((corner & 1) != 0 ? scene.high[0] : scene.low[0],
                       (corner & 2) != 0 ? scene.high[1] : scene.low[1],
                       (corner & 4) != 0 ? scene.high[2] : scene.low[2]);
    largest = std::max(largest, velocity_at(point).norm());
  }
  return largest;
}

}  // namespace malleus::forge
