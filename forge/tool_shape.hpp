#pragma once

/// The surface of a rigid tool as a signed distance, in the tool's own frame.

#include <memory>
#include <vector>

#include "forge/geometry.hpp"

namespace malleus::forge {

/// What a point sees of a tool.
struct SurfaceContact {
  Real distance = 0;                ///< m; positive on the material's side, negative inside the tool
  Vector normal = Vector::UnitX();  ///< unit, out of the tool toward the material: the gradient of the distance
};

class ToolShape {
 public:
  virtual ~ToolShape() = default;

  /// The closest place of the surface.
  virtual SurfaceContact nearest(const Vector& point) const = 0;

  /// Area of the surface [m^2]; in 2D its length [m], of a revolved scene the area of its revolution. 0: unlimited, or
  /// no shape of which one asks.
  virtual Real area(bool is_revolved) const {
    (void)is_revolved;
    return 0;
  }

  /// Every face that holds the point: in a concave edge or corner two or three, elsewhere one. Those with a distance
  /// below `reach` [m] are added to `contacts`.
  virtual void contacts(const Vector& point, Real reach, std::vector<SurfaceContact>& contacts) const {
    const SurfaceContact contact = nearest(point);
    if (contact.distance < reach) contacts.push_back(contact);
  }
};

/// On which side of a closed shape the material is: a punch has it outside, a container inside.
enum class Side { outside, inside };

/// normal: toward the material, any length > 0.
std::unique_ptr<ToolShape> make_plane(const Vector& point, const Vector& normal);
/// In 2D a disc.
std::unique_ptr<ToolShape> make_sphere(const Vector& centre, Real radius, Side side);
/// Infinite along its axis where length is 0; else of that length, `point` being its middle, with flat ends. With the
/// material inside it is a container, whose ends (if finite) and wall hold at the same time. In 2D an axis along z
/// makes a disc.
std::unique_ptr<ToolShape> make_cylinder(const Vector& point, const Vector& axis, Real radius, Real length, Side side);
/// Edges along the axes. An edge length of 0 is unlimited (z in 2D). With the material inside, each face holds by
/// itself.
std::unique_ptr<ToolShape> make_box(const Vector& centre, const Vector& size, Side side);

}  // namespace malleus::forge
