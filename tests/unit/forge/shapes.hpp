#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "forge/facet_tree.hpp"
#include "forge/tool_shape.hpp"

namespace malleus::forge::test {

/// A repeatable cloud of points within [-size, size]^3 (z = 0 in 2D).
inline std::vector<Vector> cloud(int count, Real size, int dim = 3) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<Real> place(-size, size);
  std::vector<Vector> points;
  for (int i = 0; i < count; ++i) {
    Vector point(place(generator), place(generator), place(generator));
    if (dim == 2) point[2] = 0;
    points.push_back(point);
  }
  return points;
}

/// The gradient of the distance by central differences.
inline Vector numerical_gradient(const ToolShape& shape, const Vector& point, Real step = 1e-6) {
  Vector gradient;
  for (int i = 0; i < 3; ++i) {
    const Vector shift = step * Vector::Unit(i);
    gradient[i] = (shape.nearest(point + shift).distance - shape.nearest(point - shift).distance) / (2 * step);
  }
  return gradient;
}

/// The surface of the box [low, high], two triangles a face, normals outward.
inline FacetSet box_surface(const Vector& low, const Vector& high) {
  FacetSet set;
  for (int i = 0; i < 8; ++i) {
    set.points.emplace_back((i & 1) != 0 ? high[0] : low[0], (i & 2) != 0 ? high[1] : low[1],
                            (i & 4) != 0 ? high[2] : low[2]);
  }
  const LocalId quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& quad : quads) {
    set.facets.push_back({quad[0], quad[1], quad[2]});
    set.facets.push_back({quad[0], quad[2], quad[3]});
  }
  return set;
}

/// A sphere of `bands` x 2 bands facets.
inline FacetSet sphere_surface(const Vector& centre, Real radius, int bands) {
  FacetSet set;
  const int around = 2 * bands;
  set.points.push_back(centre - radius * Vector::UnitZ());
  for (int i = 1; i < bands; ++i) {
    const Real polar = std::numbers::pi * (i / static_cast<Real>(bands) - 0.5);
    for (int j = 0; j < around; ++j) {
      const Real turn = 2 * std::numbers::pi * j / around;
      set.points.push_back(centre + radius * Vector(std::cos(polar) * std::cos(turn), std::cos(polar) * std::sin(turn),
                                                    std::sin(polar)));
    }
  }
  set.points.push_back(centre + radius * Vector::UnitZ());
  const auto last = static_cast<LocalId>(set.points.size() - 1);
  const auto at = [&](int i, int j) { return static_cast<LocalId>(1 + (i - 1) * around + j % around); };
  for (int j = 0; j < around; ++j) {
    set.facets.push_back({0, at(1, j + 1), at(1, j)});
    set.facets.push_back({last, at(bands - 1, j), at(bands - 1, j + 1)});
    for (int i = 1; i + 1 < bands; ++i) {
      set.facets.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      set.facets.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return set;
}

}  // namespace malleus::forge::test
