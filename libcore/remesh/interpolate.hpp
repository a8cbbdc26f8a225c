#pragma once

/// Fields from one mesh to another, by locating points in the old one. Everything here is local.

#include <memory>
#include <span>
#include <vector>

#include "remesh/remesh_mesh.hpp"

namespace malleus {

/// Where points lie in a mesh.
struct PointLocations {
  std::vector<LocalId> element;  ///< [point]
  std::vector<Real> weights;     ///< [point][dimension+1], barycentric, in [0, 1], of sum 1
};

/// A mesh made ready for finding points in it. The mesh may be changed or destroyed afterwards.
class PointLocator {
 public:
  explicit PointLocator(const RemeshMesh& mesh);
  PointLocator(PointLocator&&) noexcept;
  PointLocator& operator=(PointLocator&&) noexcept;
  ~PointLocator();

  /// points: [point][dimension]. region: [point], or empty; where it is given a point is looked for in the body (face-
  /// connected elements) that holds that region nearest to it, so that touching bodies are not mixed up. Points outside
  /// go to the nearest element found, with weights clamped. Fast for points in a spatial order. InputError for a mesh
  /// without elements.
  PointLocations locate(std::span<const Real> points, std::span<const std::int32_t> region = {}) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

/// Linear interpolation of values at nodes: constants and linear fields are exact, and nothing leaves the range of the
/// old values. values: [old node][components]; result: [point][components].
std::vector<Real> interpolate(const RemeshMesh& old_mesh, const PointLocations& at, std::span<const Real> values,
                              int components);

/// Values of elements on a new mesh of the same body, as means of the old values over points spread in each new
/// element. With `conserve` the integral over each region is then restored exactly: by a factor where a component has
/// one sign in the region (so positive stays positive), else by a constant. Constants are exact where the volumes
/// agree. values: [old element][components]; result: [new element][components].
std::vector<Real> transfer_elements(const RemeshMesh& old_mesh, const RemeshMesh& new_mesh,
                                    std::span<const Real> values, int components, bool conserve);

}  // namespace malleus
