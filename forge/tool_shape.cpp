#include "forge/tool_shape.hpp"

#include <cmath>

#include "base/error.hpp"

namespace malleus::forge {
namespace {

class Plane final : public ToolShape {
 public:
  Plane(const Vector& point, const Vector& normal) : point_(point), normal_(normal.normalized()) {}
  SurfaceContact nearest(const Vector& point) const override { return {normal_.dot(point - point_), normal_}; }

 private:
  Vector point_;
  Vector normal_;
};

/// `offset` scaled to length 1; where it has none, any fixed direction.
Vector direction_or(const Vector& offset, const Vector& fallback) {
  const Real length = offset.norm();
  return length > 0 ? Vector(offset / length) : fallback;
}

SurfaceContact facing(SurfaceContact contact, Side side) {
  if (side == Side::outside) return contact;
  return {-contact.distance, -contact.normal};
}

class Sphere final : public ToolShape {
 public:
  Sphere(const Vector& centre, Real radius, Side side) : centre_(centre), radius_(radius), side_(side) {}
  SurfaceContact nearest(const Vector& point) const override {
    const Vector offset = point - centre_;
    return facing({offset.norm() - radius_, direction_or(offset, Vector::UnitX())}, side_);
  }

 private:
  Vector centre_;
  Real radius_;
  Side side_;
};

/// Distance to a convex shape whose faces, near the point, are at signed distances d along unit directions n that are
/// orthogonal to each other.
template <std::size_t N>
SurfaceContact convex_corner(const std::array<Real, N>& d, const std::array<Vector, N>& n) {
  Vector outside = Vector::Zero();
  std::size_t largest = 0;
  for (std::size_t i = 0; i < N; ++i) {
    if (d[i] > 0) outside += d[i] * n[i];
    if (d[i] > d[largest]) largest = i;
  }
  const Real distance = outside.norm();
  if (distance > 0) return {distance, outside / distance};
  return {d[largest], n[largest]};
}

class Cylinder final : public ToolShape {
 public:
  Cylinder(const Vector& point, const Vector& axis, Real radius, Real length, Side side)
      : point_(point), axis_(axis.normalized()), radius_(radius), half_(0.5 * length), side_(side) {}

  SurfaceContact nearest(const Vector& point) const override {
    const Faces faces = faces_of(point);
    if (side_ == Side::outside) {
      return half_ > 0 ? convex_corner<2>(faces.distances, faces.normals)
                       : SurfaceContact{faces.distances[0], faces.normals[0]};
    }
    const std::size_t closest = half_ > 0 && faces.distances[1] > faces.distances[0] ? 1 : 0;
    return facing({faces.distances[closest], faces.normals[closest]}, side_);
  }

  void contacts(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const override {
    if (side_ == Side::outside || half_ == 0) return ToolShape::contacts(point, reach, found);
    const Faces faces = faces_of(point);
    for (std::size_t i = 0; i < 2; ++i) {
      if (-faces.distances[i] < reach) found.push_back(facing({faces.distances[i], faces.normals[i]}, side_));
    }
  }

 private:
  struct Faces {
    std::array<Real, 2> distances;  ///< wall, nearer end; positive outside the solid cylinder
    std::array<Vector, 2> normals;
  };
  Faces faces_of(const Vector& point) const {
    const Vector offset = point - point_;
    const Real along = axis_.dot(offset);
    const Vector radial = offset - along * axis_;
    return {{radial.norm() - radius_, std::abs(along) - half_},
            {direction_or(radial, axis_.unitOrthogonal()), along < 0 ? Vector(-axis_) : axis_}};
  }

  Vector point_;
  Vector axis_;
  Real radius_;
  Real half_;
  Side side_;
};

class BoxShape final : public ToolShape {
 public:
  BoxShape(const Vector& centre, const Vector& size, Side side) : centre_(centre), side_(side) {
    for (int i = 0; i < 3; ++i) half_[i] = size[i] > 0 ? 0.5 * size[i] : unlimited;
  }

  SurfaceContact nearest(const Vector& point) const override {
    const Vector offset = point - centre_;
    std::array<Real, 3> distances{};
    std::array<Vector, 3> normals;
    std::size_t largest = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      distances[i] = std::abs(offset[axis]) - half_[axis];
      normals[i] = std::copysign(1.0, offset[axis]) * Vector::Unit(axis);
      if (distances[i] > distances[largest]) largest = i;
    }
    if (side_ == Side::outside) return convex_corner<3>(distances, normals);
    return facing({distances[largest], normals[largest]}, side_);
  }

  void contacts(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const override {
    if (side_ == Side::outside) return ToolShape::contacts(point, reach, found);
    for (int axis = 0; axis < 3; ++axis) {
      for (const Real sign : {-1.0, 1.0}) {
        const Real distance = half_[axis] - sign * (point[axis] - centre_[axis]);
        if (distance < reach) found.push_back({distance, -sign * Vector::Unit(axis)});
      }
    }
  }

 private:
  static constexpr Real unlimited = 1e100;
  Vector centre_;
  Vector half_ = Vector::Zero();
  Side side_;
};

}  // namespace

std::unique_ptr<ToolShape> make_plane(const Vector& point, const Vector& normal) {
  check(normal.norm() > 0, "a plane has a normal");
  return std::make_unique<Plane>(point, normal);
}

std::unique_ptr<ToolShape> make_sphere(const Vector& centre, Real radius, Side side) {
  check(radius > 0, "a sphere has a radius");
  return std::make_unique<Sphere>(centre, radius, side);
}

std::unique_ptr<ToolShape> make_cylinder(const Vector& point, const Vector& axis, Real radius, Real length, Side side) {
  check(radius > 0 && length >= 0 && axis.norm() > 0, "a cylinder has an axis and a radius");
  return std::make_unique<Cylinder>(point, axis, radius, length, side);
}

std::unique_ptr<ToolShape> make_box(const Vector& centre, const Vector& size, Side side) {
  check(size.minCoeff() >= 0 && size.maxCoeff() > 0, "a box has an edge");
  return std::make_unique<BoxShape>(centre, size, side);
}

}  // namespace malleus::forge
