#pragma once

/// The editable mesh inside the remesher: simplices with neighbours, and where each vertex belongs.

#include <limits>
#include <unordered_map>
#include <vector>

#include "remesh/geometry.hpp"
#include "remesh/remesh_mesh.hpp"
#include "remesh/vertex_metric.hpp"

namespace malleus::remeshing {

/// A face of an element as one number: 4 * element + local face. no_face on the boundary.
using FaceRef = LocalId;
inline constexpr FaceRef no_face = -1;
constexpr FaceRef face_ref(LocalId element, std::size_t face) {
  return 4 * element + static_cast<LocalId>(face);
}
constexpr LocalId element_of(FaceRef ref) {
  return ref >> 2;
}
constexpr std::size_t local_face(FaceRef ref) {
  return static_cast<std::size_t>(ref & 3);
}

inline constexpr std::int16_t no_patch = -1;

/// Lists that an element waits on.
namespace pending {
inline constexpr std::uint8_t swap = 1;
inline constexpr std::uint8_t length = 2;
}  // namespace pending

template <int D>
struct Element {
  std::array<LocalId, D + 1> node;        ///< node[0] = -1: a free slot
  std::array<FaceRef, D + 1> neighbour;   ///< the same face seen from the other side
  std::array<std::int16_t, D + 1> patch;  ///< surface patch that the face lies on, or no_patch
  std::int16_t region = 0;                ///< index in WorkingMesh::regions
  std::uint8_t waits = 0;                 ///< bits of pending
  float key = 0;                          ///< shape key in metric space
  std::uint32_t stamp = 0;                ///< of the last ball that was gathered with it, see WorkingMesh::stamp
  std::uint16_t tried = 0;                ///< bits: edges (from 0) and faces (from 6) where no swap gained

  bool is_live() const { return node[0] >= 0; }
  bool has(LocalId vertex) const {
    bool found = false;
    for (const LocalId n : node) found |= n == vertex;
    return found;
  }
  /// Without branches: where a vertex stands is random. D as well for a vertex that the element has not.
  std::size_t index_of(LocalId vertex) const {
    std::size_t i = D;
    for (std::size_t k = 0; k < D; ++k) i = node[k] == vertex ? k : i;
    return i;
  }
};

/// What a vertex may do: it moves and merges within its entity only. dimension 0: a corner, stays. 1: on a curve (in
/// 2D, on a boundary patch). 2: on a surface patch. D: inside.
struct Vertex {
  LocalId element = -1;        ///< one live element that has it; -1: a free slot
  std::int32_t entity = -1;    ///< curve (dimension 1 in 3D) or patch (dimension D-1)
  LocalId input_element = -1;  ///< element of the input mesh near it
  LocalId input_face = -1;     ///< surface face or curve edge of the input mesh near it
  std::uint8_t dimension = 3;
  bool frozen : 1 = false;  ///< on a parallel interface
  bool fixed : 1 = false;   ///< may not move or vanish: frozen, or on a surface that is to be kept
  bool waits : 1 = false;   ///< on the list of vertices to relocate
  bool bulges : 1 = false;  ///< on a curved free surface, whose chords lose volume
  LocalId origin = -1;      ///< number of the node in the input, -1: made since
};

/// A connected piece of boundary or of an interface, bounded by feature edges.
template <int D>
struct Patch {
  std::int32_t group = -1;
  bool frozen = false;
  bool flat = true;        ///< within round-off
  bool listed = true;      ///< goes to the output's facets
  Point<D> normal{};       ///< of a flat patch, unit
  bool two_sided = false;  ///< elements on both sides
};

/// A connected chain of feature edges (3D).
struct Curve {
  std::int32_t group = -1;
  bool straight = true;
  bool locked = false;  ///< an edge in which parts of the body touch that share no face there: it stays
  Point<3> tangent{};   ///< of a straight curve, unit
};

constexpr std::uint64_t edge_key(LocalId a, LocalId b) {
  const auto low = static_cast<std::uint64_t>(a < b ? a : b);
  const auto high = static_cast<std::uint64_t>(a < b ? b : a);
  return (low << 32) | high;
}

template <int D, class Metric>
struct WorkingMesh {
  std::vector<Point<D>> points;
  std::vector<Metric> metrics;
  std::vector<Vertex> vertices;
  std::vector<Element<D>> elements;
  std::vector<LocalId> free_elements;
  std::vector<LocalId> free_vertices;
  Real bulging_factor = 1;            ///< of squared lengths on curved free surfaces, see RemeshOptions::surface_finer
  std::uint32_t stamp = 0;            ///< counts balls: an element with this stamp is in the present one
  std::vector<std::int32_t> regions;  ///< the input's numbers
  std::vector<Patch<D>> patches;
  std::vector<Curve> curves;
  std::unordered_map<std::uint64_t, std::int32_t> curve_edges;  ///< edge_key -> curve; looked up, never iterated

  const Element<D>& element(LocalId e) const { return elements[static_cast<std::size_t>(e)]; }
  Element<D>& element(LocalId e) { return elements[static_cast<std::size_t>(e)]; }
  /// Vertices of an edge of an element, edge in the order of EdgeTable. Local.
  std::array<LocalId, 2> ends(LocalId e, std::size_t edge) const {
    const auto& [i, j] = EdgeTable<D>::nodes[edge];
    return {element(e).node[i], element(e).node[j]};
  }
  const Point<D>& point(LocalId v) const { return points[static_cast<std::size_t>(v)]; }
  Point<D>& point(LocalId v) { return points[static_cast<std::size_t>(v)]; }
  const Metric& metric(LocalId v) const { return metrics[static_cast<std::size_t>(v)]; }
  Metric& metric(LocalId v) { return metrics[static_cast<std::size_t>(v)]; }
  const Vertex& vertex(LocalId v) const { return vertices[static_cast<std::size_t>(v)]; }
  Vertex& vertex(LocalId v) { return vertices[static_cast<std::size_t>(v)]; }
  const Patch<D>& patch(std::int16_t p) const { return patches[static_cast<std::size_t>(p)]; }

  Real squared_length_of(LocalId a, LocalId b) const {
    return squared_length<D>(point(a), metric(a), point(b), metric(b));
  }
  /// What decides on splitting and merging: edges on curved free surfaces may be wanted shorter.
  Real sizing_of(LocalId a, LocalId b) const {
    const Real length = squared_length_of(a, b);
    return vertex(a).bulges && vertex(b).bulges ? bulging_factor * length : length;
  }
  PointPointers<D> points_of(const Element<D>& e) const {
    PointPointers<D> x;
    for (std::size_t i = 0; i <= D; ++i) x[i] = &point(e.node[i]);
    return x;
  }
  Real key_of_element(const Element<D>& e) const {
    MetricPointers<D, Metric> m;
    for (std::size_t i = 0; i <= D; ++i) m[i] = &metric(e.node[i]);
    return shape_key<D>(points_of(e), m);
  }
  /// Curve of a feature edge, -1 for any other edge.
  std::int32_t curve_of(LocalId a, LocalId b) const {
    if (vertex(a).dimension > 1 || vertex(b).dimension > 1) return -1;
    const auto found = curve_edges.find(edge_key(a, b));
    return found == curve_edges.end() ? -1 : found->second;
  }
  LocalId count_elements() const { return static_cast<LocalId>(elements.size() - free_elements.size()); }
  LocalId count_vertices() const { return static_cast<LocalId>(vertices.size() - free_vertices.size()); }
};

/// Fills the neighbours of all elements. A face with more than two elements pairs them in order: find such input
/// before with find_overused_face.
template <int D>
void connect_elements(std::vector<Element<D>>& elements, LocalId vertices);

/// Morton order of vertices and elements; free slots vanish. Returns the new number of each old vertex (-1: gone).
template <int D, class Metric>
std::vector<LocalId> renumber(WorkingMesh<D, Metric>& mesh);

}  // namespace malleus::remeshing
