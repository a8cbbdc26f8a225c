#include <algorithm>

#include "remesh/operators.hpp"

namespace malleus::remeshing {

template <int D, class Metric>
void Operators<D, Metric>::enlist(LocalId e, std::uint8_t lists) {
  Element<D>& element = mesh_.element(e);
  const auto missing = static_cast<std::uint8_t>(lists & ~element.waits);
  if (missing == 0) return;
  element.waits = static_cast<std::uint8_t>(element.waits | missing);
  if ((missing & pending::swap) != 0) swap_list.push_back(e);
  if ((missing & pending::length) != 0) length_list.push_back(e);
}

template <int D, class Metric>
void Operators<D, Metric>::enlist_vertex(LocalId v) {
  Vertex& vertex = mesh_.vertex(v);
  if (vertex.waits) return;
  vertex.waits = true;
  move_list.push_back(v);
}

template <int D, class Metric>
void Operators<D, Metric>::commit(const StarOf& star) {
  cavity_.commit(star);
  for (const LocalId e : cavity_.made()) {
    enlist(e, pending::swap | pending::length);
    for (const LocalId v : mesh_.element(e).node) enlist_vertex(v);
  }
}

template <int D, class Metric>
LocalId Operators<D, Metric>::take_vertex() {
  if (!mesh_.free_vertices.empty()) {
    const LocalId v = mesh_.free_vertices.back();
    mesh_.free_vertices.pop_back();
    return v;
  }
  mesh_.points.emplace_back();
  mesh_.metrics.emplace_back();
  mesh_.vertices.emplace_back();
  return static_cast<LocalId>(mesh_.vertices.size()) - 1;
}

/// What the edge whose shell is gathered lies on.
template <int D, class Metric>
EntityOf Operators<D, Metric>::edge_entity(LocalId a, LocalId b) const {
  if (const std::int32_t curve = mesh_.curve_of(a, b); D == 3 && curve >= 0) return {1, curve};
  const auto on_edge = [&](const BorderFace<D>& face) {
    int ends = 0;
    for (const LocalId v : face.node) ends += (v == a || v == b) ? 1 : 0;
    return face.patch != no_patch && ends == 2;
  };
  for (const auto& face : cavity_.inner_patches()) {
    if (on_edge(face)) return {D - 1, face.patch};
  }
  if (cavity_.is_closed()) return {D, -1};
  for (const auto& face : cavity_.border()) {
    if (on_edge(face)) return {D - 1, face.patch};
  }
  return {D, -1};
}

template <int D, class Metric>
bool Operators<D, Metric>::is_near_ring(const StarOf& star) const {
  for (const LocalId v : cavity_.ring()) {
    if (squared_length<D>(star.site.position, star.site.metric, mesh_.point(v), mesh_.metric(v)) < limits.nearest_ring)
      return true;
  }
  return false;
}

/// Does the star change a curved patch? (On flat ones positive elements are proof enough.)
template <int D, class Metric>
bool Operators<D, Metric>::bends_surface(const StarOf& star) const {
  bool bends = false;
  cavity_.visit_new_patch_faces(
      star, [&](const std::array<LocalId, D>&, std::int16_t patch) { bends = bends || !mesh_.patch(patch).flat; });
  return bends;
}

template <int D, class Metric>
bool Operators<D, Metric>::faces_stay_close(const StarOf& star) const {
  bool close = true;
  cavity_.visit_new_patch_faces(star, [&](const std::array<LocalId, D>& face, std::int16_t patch) {
    if (!close || mesh_.patch(patch).flat) return;
    std::array<Point<D>, D> points;
    LocalId hint = -1;
    for (std::size_t k = 0; k < D; ++k) {
      points[k] = face[k] == star.apex ? star.site.position : mesh_.point(face[k]);
      if (face[k] >= 0 && hint < 0) hint = background_.hint(face[k], patch);
    }
    close = background_.allows_face(points, hint);
  });
  return close;
}

template <int D, class Metric>
bool Operators<D, Metric>::split_at(StarOf star, EntityOf entity, LocalId a, LocalId b) {
  star.apex = take_vertex();
  mesh_.point(star.apex) = star.site.position;
  mesh_.metric(star.apex) = star.site.metric;
  Vertex& vertex = mesh_.vertex(star.apex);
  const bool waits = vertex.waits;
  const bool bulges = entity.dimension < D && mesh_.vertex(a).bulges && mesh_.vertex(b).bulges;
  vertex = {-1,    entity.id, star.site.input_element, star.site.input_face, entity.dimension, false, false,
            waits, bulges};
  if (D == 3 && entity.dimension == 1) {
    mesh_.curve_edges.erase(edge_key(a, b));
    mesh_.curve_edges.emplace(edge_key(a, star.apex), entity.id);
    mesh_.curve_edges.emplace(edge_key(star.apex, b), entity.id);
  }
  commit(star);
  ++counts.splits;
  return true;
}

template <int D, class Metric>
bool Operators<D, Metric>::split(LocalId e, std::size_t edge) {
  const auto [a, b] = mesh_.ends(e, edge);
  if (!cavity_.gather_shell(e, edge)) return false;
  const Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  const bool inside = cavity_.is_closed() && !cavity_.has_inner_patch();
  if (!inside) cavity_.find_border();
  const EntityOf entity = inside ? EntityOf{D, -1} : edge_entity(a, b);
  if (entity.dimension < D && mesh_.vertex(a).fixed && mesh_.vertex(b).fixed) return false;
  if (D == 3 && entity.dimension == 1 && mesh_.curves[static_cast<std::size_t>(entity.id)].locked) return false;
  StarOf star{-1, background_.site_on_edge(a, b, entity), a, b};
  if (is_near_ring(star)) return false;
  if (inside) cavity_.find_border();
  if (cavity_.removes_frozen(star)) return false;
  const Real limit = std::min(limits.split_key, 0.3 * worst);
  if (cavity_.evaluate(star, limit) <= limit) {
    // The curve of the surface would turn an element over: the chord will do until relocation brings the point out.
    if (entity.dimension == D) return false;
    star.site = background_.site_on_edge(a, b, entity, true);
    if (cavity_.evaluate(star, limit) <= limit) return false;
  }
  return split_at(star, entity, a, b);
}

template class Operators<2, SizeMetric<2>>;
template class Operators<2, TensorMetric<2>>;
template class Operators<3, SizeMetric<3>>;
template class Operators<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
