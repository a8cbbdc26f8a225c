#include "remesh/input_surface.hpp"

#include <algorithm>

#include "remesh/locator.hpp"

namespace malleus::remeshing {
namespace {

constexpr int longest_walk = 100;

/// n mirrored in the plane that halves an edge of direction c (any length): on a sphere or circle that takes the normal
/// at one end to the normal at the other.
template <int D>
Point<D> mirrored(const Point<D>& n, const Point<D>& c) {
  const Real square = dot(c, c);
  return square > 0 ? shifted<D>(n, c, -2 * dot(n, c) / square) : n;
}

}  // namespace

template <int D>
template <class Metric>
void InputSurface<D>::build(WorkingMesh<D, Metric>& mesh) {
  const bool curved = std::any_of(mesh.patches.begin(), mesh.patches.end(), [](const auto& p) { return !p.flat; }) ||
                      std::any_of(mesh.curves.begin(), mesh.curves.end(), [](const auto& c) { return !c.straight; });
  if (!curved) return;
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) {
    const Element<D>& element = mesh.elements[e];
    for (std::size_t f = 0; f <= D; ++f) {
      const FaceRef other = element.neighbour[f];
      if (element.patch[f] == no_patch || mesh.patch(element.patch[f]).flat) continue;
      if (other != no_face && element_of(other) < static_cast<LocalId>(e)) continue;
      const auto& local = FaceTable<D>::nodes[f];
      if constexpr (D == 3) {
        Facet facet;
        for (std::size_t k = 0; k < 3; ++k) facet.vertex[k] = element.node[local[k]];
        for (std::size_t k = 0; k < 3; ++k) facet.corner[k] = mesh.point(facet.vertex[k]);
        facet.patch = element.patch[f];
        facets_.push_back(facet);
      } else {
        Segment segment;
        segment.vertex = {element.node[local[0]], element.node[local[1]]};
        segment.end = {mesh.point(segment.vertex[0]), mesh.point(segment.vertex[1])};
        segment.curve = element.patch[f];
        segments_.push_back(segment);
      }
    }
  }
  if constexpr (D == 3) {
    const std::map<std::uint64_t, std::int32_t> edges(mesh.curve_edges.begin(), mesh.curve_edges.end());
    for (const auto& [key, curve] : edges) {
      Segment segment;
      segment.vertex = {static_cast<LocalId>(key >> 32), static_cast<LocalId>(key & 0xffffffffU)};
      segment.end = {mesh.point(segment.vertex[0]), mesh.point(segment.vertex[1])};
      segment.curve = curve;
      segments_.push_back(segment);
    }
    connect_facets();
    orient_facets();
    set_normals();
  }
  connect_segments(mesh.vertices);
  set_tangents();
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.vertices[v].dimension == 0) mesh.vertices[v].input_face = static_cast<LocalId>(v);
  }
  for (std::size_t f = 0; f < facets_.size(); ++f) {
    for (const LocalId v : facets_[f].vertex) {
      if (mesh.vertex(v).dimension == 2) mesh.vertex(v).input_face = static_cast<LocalId>(f);
      if (mesh.vertex(v).dimension == 0) corner_facets_.emplace(Key(v, facets_[f].patch), static_cast<LocalId>(f));
    }
  }
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    for (const LocalId v : segments_[s].vertex) {
      if (mesh.vertex(v).dimension == 1) mesh.vertex(v).input_face = static_cast<LocalId>(s);
      if (mesh.vertex(v).dimension == 0) corner_segments_.emplace(Key(v, segments_[s].curve), static_cast<LocalId>(s));
    }
  }
}

/// Neighbours of facets within their patch, and the facets beside each segment.
template <int D>
void InputSurface<D>::connect_facets() {
  struct Side {
    std::uint64_t key;
    LocalId facet;
    std::size_t opposite;
  };
  std::vector<Side> sides;
  for (std::size_t f = 0; f < facets_.size(); ++f) {
    facets_[f].neighbour.fill(-1);
    const auto& v = facets_[f].vertex;
    for (std::size_t k = 0; k < 3; ++k)
      sides.push_back({edge_key(v[(k + 1) % 3], v[(k + 2) % 3]), static_cast<LocalId>(f), k});
  }
  const auto before = [](const Side& a, const Side& b) { return a.key != b.key ? a.key < b.key : a.facet < b.facet; };
  std::sort(sides.begin(), sides.end(), before);
  std::map<std::uint64_t, LocalId> features;
  for (std::size_t s = 0; s < segments_.size(); ++s)
    features.emplace(edge_key(segments_[s].vertex[0], segments_[s].vertex[1]), static_cast<LocalId>(s));
  for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
    while (last < sides.size() && sides[last].key == sides[first].key) ++last;
    const auto feature = features.find(sides[first].key);
    if (feature != features.end()) {
      for (std::size_t n = first; n < last; ++n)
        segment_facets_.emplace(Key(feature->second, facets_[static_cast<std::size_t>(sides[n].facet)].patch),
                                sides[n].facet);
    } else if (last - first == 2) {
      facets_[static_cast<std::size_t>(sides[first].facet)].neighbour[sides[first].opposite] = sides[first + 1].facet;
      facets_[static_cast<std::size_t>(sides[first + 1].facet)].neighbour[sides[first + 1].opposite] =
          sides[first].facet;
    }
  }
}

/// Turns facets so that neighbours agree on which side is which (inner surfaces come in any order).
template <int D>
void InputSurface<D>::orient_facets() {
  std::vector<char> seen(facets_.size(), 0);
  std::vector<LocalId> front;
  for (std::size_t seed = 0; seed < facets_.size(); ++seed) {
    if (seen[seed]) continue;
    seen[seed] = 1;
    front.assign(1, static_cast<LocalId>(seed));
    for (std::size_t n = 0; n < front.size(); ++n) {
      const Facet here = facets_[static_cast<std::size_t>(front[n])];
      for (std::size_t k = 0; k < 3; ++k) {
        const LocalId next = here.neighbour[k];
        if (next < 0 || seen[static_cast<std::size_t>(next)]) continue;
        Facet& there = facets_[static_cast<std::size_t>(next)];
        const LocalId a = here.vertex[(k + 1) % 3];
        const LocalId b = here.vertex[(k + 2) % 3];
        for (std::size_t j = 0; j < 3; ++j) {
          if (there.vertex[j] != a || there.vertex[(j + 1) % 3] != b) continue;
          std::swap(there.vertex[0], there.vertex[1]);
          std::swap(there.corner[0], there.corner[1]);
          std::swap(there.neighbour[0], there.neighbour[1]);
          break;
        }
        seen[static_cast<std::size_t>(next)] = 1;
        front.push_back(next);
      }
    }
  }
}

template <int D>
void InputSurface<D>::set_normals() {
  if constexpr (D == 3) {
    std::map<Key, Point<3>> normals;
    std::map<Key, bool> on_rim;
    for (const auto& facet : facets_) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Point<3> a = difference<3>(facet.corner[(k + 1) % 3], facet.corner[k]);
        const Point<3> b = difference<3>(facet.corner[(k + 2) % 3], facet.corner[k]);
        const Real weight = 1 / (dot(a, a) * dot(b, b));
        Point<3>& normal = normals[Key(facet.vertex[k], facet.patch)];
        normal = shifted<3>(normal, cross(a, b), weight);
        if (facet.neighbour[k] >= 0) continue;
        on_rim[Key(facet.vertex[(k + 1) % 3], facet.patch)] = true;
        on_rim[Key(facet.vertex[(k + 2) % 3], facet.patch)] = true;
      }
    }
    for (auto& [key, normal] : normals) normal = normalized(normal);
    // At the rim of a patch the facets lie on one side only: mirror the normals of its inner vertices instead.
    std::map<Key, Point<3>> mirror_images;
    for (const auto& facet : facets_) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Key key(facet.vertex[k], facet.patch);
        if (!on_rim.contains(key)) continue;
        for (std::size_t j = 1; j < 3; ++j) {
          const Key inner(facet.vertex[(k + j) % 3], facet.patch);
          if (on_rim.contains(inner)) continue;
          const Point<3> edge = difference<3>(facet.corner[(k + j) % 3], facet.corner[k]);
          Point<3>& sum = mirror_images[key];
          sum = shifted<3>(sum, mirrored<3>(normals[inner], edge), 1 / dot(edge, edge));
        }
      }
    }
    for (const auto& [key, sum] : mirror_images) {
      const Point<3> normal = normalized(sum);
      if (dot(normal, normals[key]) > 0.9) normals[key] = normal;
    }
    for (auto& facet : facets_) {
      for (std::size_t k = 0; k < 3; ++k) facet.normal[k] = normals[Key(facet.vertex[k], facet.patch)];
    }
  }
}

template <int D>
void InputSurface<D>::connect_segments(const std::vector<Vertex>& vertices) {
  std::map<Key, std::vector<std::pair<LocalId, std::size_t>>> ends;
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    segments_[s].neighbour.fill(-1);
    for (std::size_t k = 0; k < 2; ++k)
      ends[Key(segments_[s].vertex[k], segments_[s].curve)].emplace_back(static_cast<LocalId>(s), k);
  }
  for (const auto& [key, list] : ends) {
    if (list.size() != 2 || vertices[static_cast<std::size_t>(key.first)].dimension != 1) continue;
    segments_[static_cast<std::size_t>(list[0].first)].neighbour[list[0].second] = list[1].first;
    segments_[static_cast<std::size_t>(list[1].first)].neighbour[list[1].second] = list[0].first;
  }
}

template <int D>
void InputSurface<D>::set_tangents() {
  // Chord over squared length, summed over both sides of a vertex, is tangent to the circle through the three points.
  for (auto& segment : segments_) {
    const Point<D> chord = difference<D>(segment.end[1], segment.end[0]);
    for (std::size_t k = 0; k < 2; ++k) {
      segment.tangent[k] = shifted<D>({}, chord, 1 / dot(chord, chord));
      if (segment.neighbour[k] < 0) continue;
      const Segment& next = segments_[static_cast<std::size_t>(segment.neighbour[k])];
      const std::size_t far = next.vertex[0] == segment.vertex[k] ? 1 : 0;
      const Point<D> beyond = difference<D>(next.end[far], next.end[1 - far]);
      segment.tangent[k] = shifted<D>(segment.tangent[k], beyond, (k == 0 ? -1 : 1) / dot(beyond, beyond));
    }
  }
  for (auto& segment : segments_) {
    for (auto& tangent : segment.tangent) tangent = normalized(tangent);
    const Point<D> chord = difference<D>(segment.end[1], segment.end[0]);
    for (std::size_t k = 0; k < 2; ++k) {
      if (segment.neighbour[k] >= 0 || segment.neighbour[1 - k] < 0) continue;
      const Point<D> image = mirrored<D>(segment.tangent[1 - k], chord);
      segment.tangent[k] = shifted<D>({}, image, -1);
    }
  }
}

template <int D>
LocalId InputSurface<D>::facet_hint(const Vertex& vertex, std::int32_t patch) const {
  if (vertex.dimension == 2) return vertex.input_face;
  const auto& table = vertex.dimension == 1 ? segment_facets_ : corner_facets_;
  const auto found = table.find(Key(vertex.input_face, patch));
  return found == table.end() ? -1 : found->second;
}

template <int D>
LocalId InputSurface<D>::segment_hint(const Vertex& vertex, std::int32_t curve) const {
  if (vertex.dimension == 1) return vertex.input_face;
  const auto found = corner_segments_.find(Key(vertex.input_face, curve));
  return found == corner_segments_.end() ? -1 : found->second;
}

/// Barycentric coordinates of the foot of x in the facet's plane.
template <int D>
std::array<Real, 3> InputSurface<D>::weights_of(const Facet& facet, const Point<D>& x) {
  const Point<D> a = difference<D>(facet.corner[1], facet.corner[0]);
  const Point<D> b = difference<D>(facet.corner[2], facet.corner[0]);
  const Point<D> c = difference<D>(x, facet.corner[0]);
  const Real aa = dot(a, a);
  const Real ab = dot(a, b);
  const Real bb = dot(b, b);
  const Real determinant = aa * bb - ab * ab;
  if (!(determinant > 1e-30 * aa * bb)) return {1.0 / 3, 1.0 / 3, 1.0 / 3};
  const Real u = (bb * dot(a, c) - ab * dot(b, c)) / determinant;
  const Real v = (aa * dot(b, c) - ab * dot(a, c)) / determinant;
  return {1 - u - v, u, v};
}

/// The PN triangle's cubic Bezier form.
template <int D>
Point<D> InputSurface<D>::evaluate(const Facet& facet, const std::array<Real, 3>& w) {
  Point<D> sum{};
  Point<D> edge_points{};
  Point<D> corners{};
  for (std::size_t i = 0; i < 3; ++i) {
    sum = shifted<D>(sum, facet.corner[i], w[i] * w[i] * w[i]);
    corners = shifted<D>(corners, facet.corner[i], 1.0 / 3);
    for (std::size_t j = 0; j < 3; ++j) {
      if (i == j) continue;
      const Real rise = dot(difference<D>(facet.corner[j], facet.corner[i]), facet.normal[i]);
      Point<D> control = between<D>(facet.corner[i], facet.corner[j], 1.0 / 3);
      control = shifted<D>(control, facet.normal[i], -rise / 3);
      sum = shifted<D>(sum, control, 3 * w[i] * w[i] * w[j]);
      edge_points = shifted<D>(edge_points, control, 1.0 / 6);
    }
  }
  const Point<D> middle = between<D>(corners, edge_points, 1.5);
  return shifted<D>(sum, middle, 6 * w[0] * w[1] * w[2]);
}

template <int D>
Point<D> InputSurface<D>::evaluate(const Segment& segment, Real t) {
  const Real length = std::sqrt(squared_distance<D>(segment.end[0], segment.end[1]));
  Point<D> x = between<D>(segment.end[0], segment.end[1], t * t * (3 - 2 * t));
  x = shifted<D>(x, segment.tangent[0], length * t * (1 - t) * (1 - t));
  return shifted<D>(x, segment.tangent[1], -length * t * t * (1 - t));
}

template <int D>
SurfacePoint<D> InputSurface<D>::on_patch(const Point<D>& x, LocalId start) const {
  LocalId at = start;
  LocalId before = -1;
  std::array<Real, 3> weights{};
  for (int step = 0; step < longest_walk; ++step) {
    const Facet& facet = facets_[static_cast<std::size_t>(at)];
    weights = weights_of(facet, x);
    LocalId next = -1;
    Real lowest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      if (weights[k] >= lowest || facet.neighbour[k] < 0) continue;
      lowest = weights[k];
      next = facet.neighbour[k];
    }
    if (next < 0 || next == before) break;
    before = at;
    at = next;
  }
  clamp_weights(weights);
  const Facet& facet = facets_[static_cast<std::size_t>(at)];
  SurfacePoint<D> result{evaluate(facet, weights), {}, at};
  for (std::size_t k = 0; k < 3; ++k) result.direction = shifted<D>(result.direction, facet.normal[k], weights[k]);
  result.direction = normalized(result.direction);
  return result;
}

template <int D>
SurfacePoint<D> InputSurface<D>::on_curve(const Point<D>& x, LocalId start) const {
  LocalId at = start;
  LocalId before = -1;
  Real t = 0;
  for (int step = 0; step < longest_walk; ++step) {
    const Segment& segment = segments_[static_cast<std::size_t>(at)];
    const Point<D> chord = difference<D>(segment.end[1], segment.end[0]);
    t = dot(difference<D>(x, segment.end[0]), chord) / dot(chord, chord);
    if (t >= 0 && t <= 1) break;
    const LocalId next = segment.neighbour[t < 0 ? 0 : 1];
    if (next < 0 || next == before) break;
    before = at;
    at = next;
  }
  t = std::clamp(t, 0.0, 1.0);
  const Segment& segment = segments_[static_cast<std::size_t>(at)];
  return {evaluate(segment, t), normalized(between<D>(segment.tangent[0], segment.tangent[1], t)), at};
}

template class InputSurface<2>;
template class InputSurface<3>;
template void InputSurface<2>::build(WorkingMesh<2, SizeMetric<2>>&);
template void InputSurface<2>::build(WorkingMesh<2, TensorMetric<2>>&);
template void InputSurface<3>::build(WorkingMesh<3, SizeMetric<3>>&);
template void InputSurface<3>::build(WorkingMesh<3, TensorMetric<3>>&);

}  // namespace malleus::remeshing
