#include <algorithm>

#include "remesh/operators.hpp"

namespace malleus::remeshing {

/// May v merge into w as far as the classes go? The ball of v must be gathered and its border found.
template <int D, class Metric>
bool Operators<D, Metric>::may_collapse(LocalId v, LocalId w) const {
  const Vertex& vertex = mesh_.vertex(v);
  if (vertex.dimension == D) return true;
  if (vertex.dimension == 1 && D == 3) return mesh_.curve_of(v, w) >= 0;
  const auto along = [&](const BorderFace<D>& face) {
    int ends = 0;
    for (const LocalId n : face.node) ends += (n == v || n == w) ? 1 : 0;
    return face.patch == vertex.entity && ends == 2;
  };
  for (const auto& face : cavity_.border()) {
    if (along(face)) return true;
  }
  for (const auto& face : cavity_.inner_patches()) {
    if (along(face)) return true;
  }
  return false;
}

/// The link condition for a vertex on a patch or a curve: a vertex that is a neighbour of both v and w must be so
/// through a common face, inside and on the surface; else the merger pinches the body.
template <int D, class Metric>
bool Operators<D, Metric>::keeps_links(LocalId v, LocalId w) {
  const auto near = [&](LocalId from, std::vector<LocalId>& vertices, std::vector<LocalId>& surface) {
    for (const LocalId e : cavity_.elements()) {
      const Element<D>& element = mesh_.element(e);
      vertices.insert(vertices.end(), element.node.begin(), element.node.end());
      for (std::size_t f = 0; f <= D; ++f) {
        if (element.patch[f] == no_patch || element.node[f] == from) continue;
        for (const LocalId u : element.node) {
          if (u != element.node[f]) surface.push_back(u);
        }
      }
    }
  };
  // Vertices joined to w (all, and along the surface), by a marker set each.
  std::vector<LocalId> of_w;
  std::vector<LocalId> surface_of_w;
  if (!cavity_.gather_ball(w)) return false;
  near(w, of_w, surface_of_w);
  if (!cavity_.gather_ball(v)) return false;
  cavity_.find_border();
  std::vector<LocalId> of_v;
  std::vector<LocalId> surface_of_v;
  near(v, of_v, surface_of_v);
  const auto pinches = [&](const std::vector<LocalId>& mine, const std::vector<LocalId>& other, bool on_surface) {
    cavity_.new_vertex_marks();
    for (const LocalId u : other) cavity_.mark_vertex(u);
    std::vector<LocalId> common;
    for (const LocalId u : mine) {
      if (u != v && u != w && cavity_.is_marked(u)) common.push_back(u);
    }
    cavity_.new_vertex_marks();
    for (const LocalId e : cavity_.elements()) {
      const Element<D>& element = mesh_.element(e);
      if (!element.has(w)) continue;
      for (std::size_t f = 0; f <= D; ++f) {
        const LocalId u = element.node[f];
        if (!on_surface) cavity_.mark_vertex(u);
        if (element.patch[f] == no_patch || u == v || u == w) continue;
        for (const LocalId n : element.node) {
          if (on_surface && n != u) cavity_.mark_vertex(n);
        }
      }
    }
    return std::any_of(common.begin(), common.end(), [&](LocalId u) { return !cavity_.is_marked(u); });
  };
  return !pinches(of_v, of_w, false) && !pinches(surface_of_v, surface_of_w, true);
}

/// The feature edge from v to its other neighbour on the curve now ends at w.
template <int D, class Metric>
void Operators<D, Metric>::move_curve_edges(LocalId v, LocalId w) {
  const std::int32_t curve = mesh_.curve_of(v, w);
  mesh_.curve_edges.erase(edge_key(v, w));
  for (const auto& face : cavity_.border()) {
    for (const LocalId u : face.node) {
      if (u == v || u == w || mesh_.curve_of(u, v) < 0) continue;
      mesh_.curve_edges.erase(edge_key(u, v));
      mesh_.curve_edges.emplace(edge_key(u, w), curve);
    }
  }
}

template <int D, class Metric>
bool Operators<D, Metric>::collapse(LocalId v, LocalId w) {
  const Vertex& vertex = mesh_.vertex(v);
  if (vertex.fixed || vertex.dimension == 0 || vertex.dimension < mesh_.vertex(w).dimension) return false;
  const auto stays_short = [&](LocalId u) { return u == v || mesh_.sizing_of(u, w) <= limits.longest_made; };
  if (!cavity_.gather_ball_while(v, stays_short)) return false;
  const Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  cavity_.find_border();
  if (!may_collapse(v, w)) return false;
  StarOf star = star_from(w);
  star.removed_a = v;
  const Real limit = std::max(std::min(0.6 * worst, limits.collapse_key), limits.collapse_gain * worst);
  if (cavity_.evaluate(star, limit) <= limit) return false;
  if (vertex.dimension < D) {
    if (cavity_.removes_frozen(star) || !faces_stay_close(star)) return false;
    if (bends_surface(star) && !keeps_links(v, w)) return false;
    if (D == 3 && vertex.dimension == 1) move_curve_edges(v, w);
  }
  commit(star);
  mesh_.vertex(v).element = -1;
  mesh_.free_vertices.push_back(v);
  ++counts.collapses;
  return true;
}

template class Operators<2, SizeMetric<2>>;
template class Operators<2, TensorMetric<2>>;
template class Operators<3, SizeMetric<3>>;
template class Operators<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
