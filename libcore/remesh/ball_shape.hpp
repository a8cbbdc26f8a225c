#pragma once

/// The elements around a vertex, each by its face opposite the vertex. Where the metric only scales, their shapes are
/// functions of the vertex's place: the volume is linear in it, the sum of squared edge lengths quadratic.

#include <vector>

#include "remesh/vertex_metric.hpp"

namespace malleus::remeshing {

/// Places are relative to an origin near the ball, so that the squares lose no digits.
template <int D>
class BallShape {
 public:
  struct Spoke {
    Point<D> normal{};  ///< of the face, inwards; scaled volume = normal . x + offset
    Real offset = 0;
    Point<D> sum{};    ///< of the face's nodes
    Real squares = 0;  ///< of the face's nodes' distances from the origin and of its edges
    float key = 0;     ///< as it was noted
  };

  void clear() { spokes_.clear(); }
  /// An element by its face opposite the vertex: the face's nodes relative to the origin, seen from inside.
  void add(const std::array<Point<D>, D>& face, const Point<D>& inward_normal, float key) {
    Spoke spoke;
    spoke.key = key;
    spoke.normal = inward_normal;
    spoke.offset = -dot(inward_normal, face[0]);
    for (std::size_t k = 0; k < D; ++k) {
      spoke.squares += dot(face[k], face[k]);
      for (std::size_t i = 0; i < D; ++i) spoke.sum[i] += face[k][i];
      for (std::size_t l = 0; l < k; ++l) spoke.squares += squared_distance<D>(face[k], face[l]);
    }
    spokes_.push_back(spoke);
  }
  /// Shape key of element n with the vertex at x.
  Real key(std::size_t n, const Point<D>& x) const {
    const Spoke& spoke = spokes_[n];
    return key_of<D>(dot(spoke.normal, x) + spoke.offset, spoke.squares + D * dot(x, x) - 2 * dot(spoke.sum, x));
  }

  std::span<const Spoke> spokes() const { return spokes_; }

 private:
  std::vector<Spoke> spokes_;
};

}  // namespace malleus::remeshing
