#pragma once

/// Flows and shapes of the level-set tests, on a mesh of the unit square or cube.

#include <cmath>
#include <numbers>
#include <vector>

#include "fem/cut_simplex.hpp"
#include "fem/level_set_shapes.hpp"
#include "fem/level_set_volume.hpp"
#include "mesh/node_graph.hpp"
#include "solvers/level_set_transport.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus::test {

inline Position position_of(const Mesh& mesh, LocalId node) {
  Position at = {0, 0, 0};
  for (int c = 0; c < mesh.dim; ++c) at[static_cast<std::size_t>(c)] = mesh.point(node)[c];
  return at;
}

/// Values of a function of position at the nodes.
template <class Function>
std::vector<Real> at_nodes(const Mesh& mesh, Function function) {
  std::vector<Real> values;
  for (LocalId n = 0; n < mesh.nodes(); ++n) values.push_back(function(position_of(mesh, n)));
  return values;
}

/// A flow as a function of position and time, at the nodes: [node][dim].
template <class Flow>
std::vector<Real> velocity_at_nodes(const Mesh& mesh, Flow flow, Real time) {
  std::vector<Real> values;
  for (LocalId n = 0; n < mesh.nodes(); ++n) {
    const Position v = flow(position_of(mesh, n), time);
    values.insert(values.end(), v.begin(), v.begin() + mesh.dim);
  }
  return values;
}

/// The reversed vortex of Rider and Kothe (1998) with period 8 s: the worst deformation is at 4 s.
inline Position vortex(const Position& at, Real time) {
  constexpr Real pi = std::numbers::pi;
  const Real strength = std::cos(pi * time / 8);
  const Real sx = std::sin(pi * at[0]), cx = std::cos(pi * at[0]), sy = std::sin(pi * at[1]), cy = std::cos(pi * at[1]);
  return {-2 * strength * sx * sx * sy * cy, 2 * strength * sy * sy * sx * cx, 0};
}

/// Where the point was at time 0 (Runge and Kutta's fourth order in `steps` steps).
template <class Flow>
Position trace_back(Flow flow, Position at, Real time, int steps) {
  const Real dt = -time / steps;
  const auto moved = [](const Position& from, const Position& by, Real factor) {
    return Position{from[0] + factor * by[0], from[1] + factor * by[1], from[2] + factor * by[2]};
  };
  for (int s = 0; s < steps; ++s, time += dt) {
    const Position k1 = flow(at, time), k2 = flow(moved(at, k1, dt / 2), time + dt / 2);
    const Position k3 = flow(moved(at, k2, dt / 2), time + dt / 2), k4 = flow(moved(at, k3, dt), time + dt);
    for (std::size_t c = 0; c < 3; ++c) at[c] += dt / 6 * (k1[c] + 2 * k2[c] + 2 * k3[c] + k4[c]);
  }
  return at;
}

/// Area where the level set and `is_inside` differ, by 9 points an element of a 2D mesh.
template <class Inside>
Real misplaced_area(const Mesh& mesh, const std::vector<Real>& level_set, Inside is_inside) {
  Real area = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const SimplexPoints<2> points = simplex_points<2>(mesh, e);
    const auto nodes = mesh.nodes_of_element(e);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; i + j < 3; ++j) {
        const Real a = (i + 1.0 / 3) / 3, b = (j + 1.0 / 3) / 3, c = 1 - a - b;
        const Point<2> at = points * Eigen::Vector3d(a, b, c);
        const Real value = a * level_set[static_cast<std::size_t>(nodes[0])] +
                           b * level_set[static_cast<std::size_t>(nodes[1])] +
                           c * level_set[static_cast<std::size_t>(nodes[2])];
        if ((value > 0) != is_inside(Position{at[0], at[1], 0})) area += simplex_volume<2>(points) / 6;
      }
    }
  }
  return world().sum(area);
}

}  // namespace malleus::test
