#pragma once

/// The size law of a remesh: how long an edge should be, per direction and place.

#include <vector>

#include "remesh/remesh_mesh.hpp"

namespace malleus {

/// A metric M gives an edge e the length sqrt(e.M.e); the remesher makes edges of length 1. Kept as one constant size,
/// a size h per node (M = I/h^2), or a symmetric positive tensor per node [1/m^2], packed as in Medit files: 2D xx, xy,
/// yy; 3D xx, xy, yy, xz, yz, zz.
class Metric {
 public:
  enum class Kind { uniform, sizes, tensors };

  /// size > 0 [m].
  static Metric uniform(Real size);
  /// sizes: [node], each > 0 [m]. InputError otherwise.
  static Metric per_node(std::vector<Real> sizes);
  /// tensors: [node][dimension (dimension + 1) / 2], each symmetric positive. InputError otherwise.
  static Metric tensors(int dimension, std::vector<Real> tensors);

  Kind kind() const { return kind_; }
  /// [1], [node] or [node][components]; sizes in m, tensors in 1/m^2.
  const std::vector<Real>& values() const { return values_; }
  std::vector<Real>& values() { return values_; }
  /// Tensor components per node; 1 for sizes.
  int components() const { return components_; }

 private:
  Metric(Kind kind, int components, std::vector<Real> values)
      : kind_(kind), components_(components), values_(std::move(values)) {}
  Kind kind_;
  int components_;
  std::vector<Real> values_;
};

/// Throws InputError where a metric does not fit the mesh.
void check_metric(const RemeshMesh& mesh, const Metric& metric);

}  // namespace malleus
