#pragma once

/// Meshes that the remesher's tests start from, and what must hold of those that come out.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "remesh/remesh.hpp"

namespace malleus::test {

/// Unit square or cube of n cells an axis, cut into 2 triangles or 6 tetrahedra each. Sides are groups 1..2 dim.
inline RemeshMesh box_mesh(int dimension, int n) {
  RemeshMesh mesh;
  mesh.dimension = dimension;
  const int side = n + 1;
  const int layers = dimension == 3 ? side : 1;
  const auto id = [&](int i, int j, int k) { return static_cast<LocalId>(i + side * (j + side * k)); };
  for (int k = 0; k < layers; ++k) {
    for (int j = 0; j < side; ++j) {
      for (int i = 0; i < side; ++i) {
        const std::array<Real, 3> x = {i / Real(n), j / Real(n), k / Real(n)};
        mesh.coordinates.insert(mesh.coordinates.end(), x.begin(), x.begin() + dimension);
      }
    }
  }
  const std::array<std::array<int, 3>, 6> orders = {{{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}}};
  for (int k = 0; k < (dimension == 3 ? n : 1); ++k) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        for (int o = 0; o < (dimension == 3 ? 6 : 2); ++o) {
          std::array<int, 3> at = {i, j, k};
          std::vector<LocalId> nodes = {id(i, j, k)};
          for (int step = 0; step < dimension; ++step) {
            const int axis = dimension == 3 ? orders[o][step] : (o + step) % 2;
            ++at[axis];
            nodes.push_back(id(at[0], at[1], at[2]));
          }
          if (o >= (dimension == 3 ? 3 : 1)) std::swap(nodes[0], nodes[1]);
          mesh.element_nodes.insert(mesh.element_nodes.end(), nodes.begin(), nodes.end());
          mesh.element_region.push_back(1);
        }
      }
    }
  }
  return mesh;
}

/// Faces of all elements: sorted nodes -> elements.
inline std::map<std::vector<LocalId>, std::vector<LocalId>> faces_of(const RemeshMesh& mesh) {
  std::map<std::vector<LocalId>, std::vector<LocalId>> faces;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t f = 0; f < nodes.size(); ++f) {
      std::vector<LocalId> face;
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        if (k != f) face.push_back(nodes[k]);
      }
      std::sort(face.begin(), face.end());
      faces[face].push_back(e);
    }
  }
  return faces;
}

/// Adds the exterior facets of a box to its lists, a group per side.
inline void group_sides(RemeshMesh& mesh) {
  for (const auto& [face, elements] : faces_of(mesh)) {
    if (elements.size() != 1) continue;
    int group = 0;
    for (int axis = 0; axis < mesh.dimension; ++axis) {
      for (const Real value : {0.0, 1.0}) {
        const bool on = std::all_of(face.begin(), face.end(), [&](LocalId v) { return mesh.point(v)[axis] == value; });
        if (on) group = 1 + 2 * axis + static_cast<int>(value);
      }
    }
    mesh.facet_nodes.insert(mesh.facet_nodes.end(), face.begin(), face.end());
    mesh.facet_group.push_back(group);
  }
}

inline Real simplex_measure(const RemeshMesh& mesh, std::span<const LocalId> nodes) {
  const int d = mesh.dimension;
  std::array<std::array<Real, 3>, 3> e{};
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    for (int k = 0; k < d; ++k)
      e[i - 1][static_cast<std::size_t>(k)] = mesh.point(nodes[i])[k] - mesh.point(nodes[0])[k];
  }
  if (d == 2) return 0.5 * (e[0][0] * e[1][1] - e[0][1] * e[1][0]);
  return (e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) - e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
          e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0])) /
         6;
}

inline Real facet_measure(const RemeshMesh& mesh, LocalId facet) {
  const auto d = static_cast<std::size_t>(mesh.dimension);
  const auto* nodes = &mesh.facet_nodes[static_cast<std::size_t>(facet) * d];
  std::array<std::array<Real, 3>, 2> e{};
  for (std::size_t i = 1; i < d; ++i) {
    for (std::size_t k = 0; k < d; ++k) e[i - 1][k] = mesh.point(nodes[i])[k] - mesh.point(nodes[0])[k];
  }
  if (d == 2) return std::hypot(e[0][0], e[0][1]);
  const Real x = e[0][1] * e[1][2] - e[0][2] * e[1][1];
  const Real y = e[0][2] * e[1][0] - e[0][0] * e[1][2];
  const Real z = e[0][0] * e[1][1] - e[0][1] * e[1][0];
  return 0.5 * std::hypot(x, y, z);
}

/// Area (length in 2D) of each boundary group.
inline std::map<std::int32_t, Real> group_areas(const RemeshMesh& mesh) {
  std::map<std::int32_t, Real> areas;
  for (LocalId f = 0; f < mesh.facets(); ++f)
    areas[mesh.facet_group[static_cast<std::size_t>(f)]] += facet_measure(mesh, f);
  return areas;
}

/// Conforming, positive, every node used, and the listed facets are exactly the faces they should be.
inline void expect_sound(const RemeshMesh& mesh) {
  check_arrays(mesh);
  std::vector<char> used(static_cast<std::size_t>(mesh.nodes()), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    EXPECT_GT(simplex_measure(mesh, mesh.nodes_of_element(e)), 0) << "element " << e;
    for (const LocalId v : mesh.nodes_of_element(e)) used[static_cast<std::size_t>(v)] = 1;
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), 0), 0);
  const auto faces = faces_of(mesh);
  std::set<std::vector<LocalId>> listed;
  const auto d = static_cast<std::size_t>(mesh.dimension);
  for (std::size_t f = 0; f < mesh.facet_group.size(); ++f) {
    std::vector<LocalId> nodes(mesh.facet_nodes.begin() + static_cast<std::ptrdiff_t>(f * d),
                               mesh.facet_nodes.begin() + static_cast<std::ptrdiff_t>((f + 1) * d));
    std::sort(nodes.begin(), nodes.end());
    EXPECT_EQ(faces.count(nodes), 1U) << "facet " << f << " is no face";
    EXPECT_TRUE(listed.insert(nodes).second) << "facet " << f << " is listed twice";
  }
  for (const auto& [face, elements] : faces) EXPECT_LE(elements.size(), 2U);
}

}  // namespace malleus::test
