#include "forge/build_tool.hpp"

#include <cmath>
#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "base/log.hpp"
#include "forge/surface_file.hpp"
#include "forge/surface_shape.hpp"
#include "parallel/agreement.hpp"

namespace malleus::forge {
namespace {

Vector vector_of(const std::array<Real, 3>& values) {
  return {values[0], values[1], values[2]};
}

std::unique_ptr<ToolShape> build_surface(const ToolSettings& settings, int dim, std::string& warning) {
  FacetSet set = read_surface_file(settings.file.string(), dim, settings.surface_scale());
  for (Vector& point : set.points) point += vector_of(settings.point);
  SurfaceReport report;
  std::unique_ptr<ToolShape> shape;
  try {
    shape = make_surface(std::move(set), settings.side, report);
  } catch (const InputError& error) {
    throw InputError("[tool." + settings.name + "] file = " + settings.file.string() + ": " + error.what());
  }
  if (!report.closed) warning = "tool " + settings.name + ": its surface is not closed; sides are told near it only";
  if (report.turned) warning = "tool " + settings.name + ": the normals of its surface pointed inward and were turned";
  return shape;
}

std::unique_ptr<ToolShape> build_shape(const ToolSettings& settings, int dim, std::string& warning) {
  const Vector point = vector_of(settings.point);
  switch (settings.shape) {
    case ShapeKind::plane:
      return make_plane(point, vector_of(*settings.normal));
    case ShapeKind::sphere:
      return make_sphere(point, *settings.radius, settings.side);
    case ShapeKind::cylinder:
      return make_cylinder(point, settings.axis ? vector_of(*settings.axis) : Vector(Vector::UnitZ()), *settings.radius,
                           settings.length.value_or(0), settings.side);
    case ShapeKind::box:
      return make_box(point, vector_of(*settings.size), settings.side);
    case ShapeKind::surface:
      return build_surface(settings, dim, warning);
  }
  return nullptr;
}

Vector given_velocity(const ToolSettings& settings, Real time) {
  if (settings.velocity) return vector_of(*settings.velocity);
  Vector velocity = Vector::Zero();
  for (std::size_t c = 0; c < 3; ++c) {
    if (settings.velocity_components[c]) {
      velocity[static_cast<Eigen::Index>(c)] = (*settings.velocity_components[c])({0, 0, 0}, time);
    }
  }
  return velocity;
}

/// Direction of the stroke. Velocities by components keep the direction in which they first move.
Vector find_direction(const ToolSettings& settings) {
  if (settings.direction) return vector_of(*settings.direction).normalized();
  for (int i = 0; i < 1000; ++i) {
    const Vector velocity = given_velocity(settings, 1e-3 * i);
    if (velocity.norm() > 0) return velocity.normalized();
  }
  const bool is_driven = !settings.stroke_file.empty() || settings.press != PressKind::speed;
  if (is_driven && settings.normal) return vector_of(*settings.normal).normalized();
  return Vector::Zero();
}

StrokeTable read_table(const ToolSettings& settings) {
  std::ifstream file(settings.stroke_file);
  if (!file) throw InputError("[tool." + settings.name + "] stroke_file: cannot read " + settings.stroke_file.string());
  std::ostringstream content;
  content << file.rdbuf();
  return read_stroke_table(content.str(), settings.stroke_file.string());
}

PressSpec build_press(const ToolSettings& settings, const Vector& direction) {
  PressSpec spec;
  spec.kind = settings.press;
  if (!settings.stroke_file.empty()) {
    spec.kind = PressKind::stroke_table;
    spec.table = read_table(settings);
  }
  spec.speed = [settings, direction](Real time) { return given_velocity(settings, time).dot(direction); };
  spec.force_limit = settings.force_limit.value_or(0);
  spec.crank_radius = settings.crank_radius.value_or(0);
  spec.rod_length = settings.rod_length.value_or(0);
  spec.rotation_speed = settings.rotation_speed.value_or(0);
  spec.start_height = settings.start_height.value_or(0);
  spec.energy = settings.energy.value_or(0);
  spec.mass = settings.mass.value_or(0);
  return spec;
}

Tool build(const ToolSettings& settings, int dim, std::string& warning) {
  ToolMotion motion;
  motion.direction = find_direction(settings);
  motion.pivot = vector_of(settings.pivot.value_or(settings.point));
  Vector axis = Vector::UnitZ();
  if (dim == 3 && settings.axis) axis = vector_of(*settings.axis).normalized();
  if (dim == 3 && settings.spin_axis) axis = vector_of(*settings.spin_axis).normalized();
  motion.rotation = settings.spin * axis;
  return {settings.name, build_shape(settings, dim, warning), motion, Press(build_press(settings, motion.direction)),
          settings.friction.spec()};
}

}  // namespace

StrokeTable read_stroke_table(const std::string& text, const std::string& name) {
  StrokeTable table;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream row(line);
    Real time = 0;
    Real position = 0;
    char comma = 0;
    const bool is_row = static_cast<bool>(row >> time >> comma >> position) && comma == ',';
    const std::string place = name + ":" + std::to_string(number);
    if (!is_row) {
      if (line.find_first_not_of(" \t\r") == std::string::npos || (number == 1 && table.times.empty())) continue;
      throw InputError(place + ": time,position expected, found: " + line);
    }
    if (!std::isfinite(time) || !std::isfinite(position)) throw InputError(place + ": a number is not finite");
    if (!table.times.empty() && !(time > table.times.back())) throw InputError(place + ": times must increase");
    table.times.push_back(time);
    table.positions.push_back(position);
  }
  if (table.times.size() < 2) throw InputError(name + ": needs two rows of time,position at least");
  return table;
}

Tool build_tool(const Communicator& comm, const ToolSettings& settings, int dim) {
  std::optional<Tool> tool;
  std::string warning;
  agree(comm, [&] { tool.emplace(build(settings, dim, warning)); });
  if (!warning.empty()) log::warn(warning);
  return std::move(*tool);
}

}  // namespace malleus::forge
