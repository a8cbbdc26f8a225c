#pragma once

/// Which simplex of a mesh holds a point, found by walking.

#include <vector>

#include "remesh/geometry.hpp"

namespace malleus::remeshing {

template <int D>
class Locator {
 public:
  struct Cell {
    std::array<LocalId, D + 1> node;
    std::array<LocalId, D + 1> neighbour;  ///< across the face opposite each node, -1 on the boundary
  };
  struct Hit {
    LocalId cell = -1;
    std::array<Real, D + 1> weights{};  ///< barycentric, clamped to [0, 1], of sum 1
    Real outside = 0;                   ///< the most negative barycentric coordinate before clamping, negated; 0 inside
  };

  Locator() = default;
  Locator(std::vector<Point<D>> points, std::vector<Cell> cells)
      : points_(std::move(points)), cells_(std::move(cells)) {}

  bool is_empty() const { return cells_.empty(); }
  const std::vector<Cell>& cells() const { return cells_; }
  const std::vector<Point<D>>& points() const { return points_; }

  /// Walks from a cell towards a point, each step across the face that it lies farthest behind; ends in the cell that
  /// holds it or in the nearest seen where the boundary is in the way. At most max_steps cells.
  Hit walk(const Point<D>& x, LocalId start, int max_steps = 500) const;

 private:
  std::array<Real, D + 1> barycentric(const Cell& cell, const Point<D>& x) const;

  std::vector<Point<D>> points_;
  std::vector<Cell> cells_;
};

/// Negative weights become zero, the others are scaled to sum 1; returns the most negative one, negated.
template <std::size_t N>
Real clamp_weights(std::array<Real, N>& weights) {
  Real outside = 0;
  Real sum = 0;
  for (Real& weight : weights) {
    outside = weight < -outside ? -weight : outside;
    weight = weight > 0 ? weight : 0;
    sum += weight;
  }
  for (Real& weight : weights) weight = sum > 0 ? weight / sum : 1.0 / N;
  return outside;
}

}  // namespace malleus::remeshing
