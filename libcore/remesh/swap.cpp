#include <algorithm>

#include "remesh/operators.hpp"

namespace malleus::remeshing {
namespace {
constexpr std::size_t largest_ring = 8;
}

/// Does an edge join a and b? The cavity is lost.
template <int D, class Metric>
bool Operators<D, Metric>::edge_exists(LocalId a, LocalId b) {
  if (!cavity_.gather_ball(a)) return true;
  for (const LocalId e : cavity_.elements()) {
    if (mesh_.element(e).has(b)) return true;
  }
  return false;
}

/// Turns an edge of a patch: the two faces at it give place to the two at the other diagonal.
template <int D, class Metric>
bool Operators<D, Metric>::swap_patch_edge(LocalId a, LocalId b, Real worst) {
  std::array<LocalId, 2> ends = {-1, -1};
  std::int16_t patch = no_patch;
  std::size_t n = 0;
  const auto collect = [&](const BorderFace<D>& face) {
    LocalId third = -1;
    int on_edge = 0;
    for (const LocalId v : face.node) {
      if (v == a || v == b) {
        ++on_edge;
      } else {
        third = v;
      }
    }
    if (face.patch == no_patch || on_edge != 2) return;
    if (n < 2) ends[n] = third;
    if (n == 1 && face.patch != patch) n = 5;
    patch = face.patch;
    ++n;
  };
  for (const auto& face : cavity_.border()) collect(face);
  for (const auto& face : cavity_.inner_patches()) collect(face);
  if (n != 2 || cavity_.elements().size() < 2) return false;
  Real best = worst * limits.swap_gain + 1e-6;
  StarOf found;
  for (const LocalId apex : ends) {
    StarOf star = star_from(apex);
    star.removed_a = a;
    star.removed_b = b;
    const Real key = cavity_.evaluate(star, best);
    if (key <= best || key > 1.5) continue;
    best = key;
    found = star;
  }
  if (found.apex < 0 || cavity_.removes_frozen(found) || !faces_stay_close(found)) return false;
  if (!mesh_.patch(patch).flat) {
    const LocalId e = cavity_.elements()[0];
    const std::size_t edge = edge_of(e, a, b);
    if (edge_exists(ends[0], ends[1])) return false;
    cavity_.gather_shell(e, edge);
    cavity_.find_border();
  }
  commit(found);
  ++counts.swaps;
  return true;
}

template <int D, class Metric>
std::size_t Operators<D, Metric>::edge_of(LocalId e, LocalId a, LocalId b) const {
  const Element<D>& element = mesh_.element(e);
  for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
    const LocalId i = element.node[EdgeTable<D>::nodes[edge][0]];
    const LocalId j = element.node[EdgeTable<D>::nodes[edge][1]];
    if ((i == a && j == b) || (i == b && j == a)) return edge;
  }
  return EdgeTable<D>::size;
}

/// Worst key of the star from ring vertex `from` (any in 2D) of an inner edge's shell; <= limit once it is known not to
/// exceed it.
template <int D, class Metric>
Real Operators<D, Metric>::ring_key(LocalId a, LocalId b, std::size_t from, Real limit) const {
  const auto ring = cavity_.ring();
  const std::size_t n = ring.size();
  PointPointers<D> x;
  MetricPointers<D, Metric> m;
  const auto set = [&](std::size_t at, LocalId v) {
    x[at] = &mesh_.point(v);
    m[at] = &mesh_.metric(v);
  };
  Real worst = 2;
  const auto lowers = [&] {
    worst = std::min(worst, shape_key<D>(x, m));
    return worst <= limit;
  };
  if constexpr (D == 2) {
    set(0, ring[0]);  // (a, b, ring[0]) is positive
    set(1, a);
    set(2, ring[1]);
    if (lowers()) return worst;
    set(1, ring[1]);
    set(2, b);
    lowers();
    return worst;
  } else {
    set(0, ring[from]);
    for (std::size_t k = 1; k + 1 < n; ++k) {
      set(1, ring[(from + k) % n]);
      set(2, ring[(from + k + 1) % n]);
      set(3, b);
      if (lowers()) return worst;
      std::swap(x[1], x[2]);
      std::swap(m[1], m[2]);
      set(3, a);
      if (lowers()) return worst;
    }
    return worst;
  }
}

/// Notes at the elements of the shell that no swap of this edge gains.
template <int D, class Metric>
void Operators<D, Metric>::note_tried(LocalId a, LocalId b) {
  for (const LocalId e : cavity_.elements()) {
    auto& tried = mesh_.element(e).tried;
    tried = static_cast<std::uint16_t>(tried | 1U << edge_of(e, a, b));
  }
}

/// Turns an edge inside by the best star from its ring.
template <int D, class Metric>
bool Operators<D, Metric>::swap_inner_edge(LocalId a, LocalId b, Real worst) {
  const auto ring = cavity_.ring();
  // Stars from opposite vertices of a ring of four are the same; so are all of a ring of three or, in 2D, two.
  const std::size_t candidates = ring.size() <= 3 ? 1 : ring.size() == 4 ? 2 : ring.size();
  Real best = worst * limits.swap_gain + 1e-6;
  LocalId apex = -1;
  for (std::size_t n = 0; n < candidates; ++n) {
    const Real key = ring_key(a, b, n, best);
    if (key <= best) continue;
    best = key;
    apex = ring[n];
  }
  if (apex < 0) return false;
  cavity_.find_border();
  commit(star_from(apex));
  ++counts.swaps;
  return true;
}

template <int D, class Metric>
bool Operators<D, Metric>::swap_edge(LocalId e, std::size_t edge) {
  const auto [a, b] = mesh_.ends(e, edge);
  const bool both_on_boundary = mesh_.vertex(a).dimension < D && mesh_.vertex(b).dimension < D;
  if (both_on_boundary && mesh_.curve_of(a, b) >= 0) return false;
  if (!cavity_.gather_shell(e, edge) || cavity_.ring().size() > largest_ring) return false;
  const Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  if (cavity_.is_closed() && !cavity_.has_inner_patch()) {
    if (swap_inner_edge(a, b, worst)) return true;
  } else if (D == 3) {
    cavity_.find_border();
    if (swap_patch_edge(a, b, worst)) return true;
    cavity_.gather_shell(e, edge);
  }
  note_tried(a, b);
  return false;
}

/// Triangles at each vertex beyond the ideal number.
template <int D, class Metric>
void Operators<D, Metric>::count_surplus() {
  surplus_.assign(mesh_.vertices.size(), -6);
  for (const auto& element : mesh_.elements) {
    if (!element.is_live()) continue;
    for (std::size_t i = 0; i <= D; ++i) {
      ++surplus_[static_cast<std::size_t>(element.node[i])];
      if (element.neighbour[i] != no_face) continue;
      // Each vertex on the boundary has two open faces there, and wants three triangles.
      for (std::size_t k = 1; k <= D; ++k) surplus_[static_cast<std::size_t>(element.node[(i + k) % (D + 1)])] += 1.5F;
    }
  }
}

template <int D, class Metric>
bool Operators<D, Metric>::balance(LocalId e, std::size_t edge) {
  if constexpr (D == 3) return false;
  const Element<D>& element = mesh_.element(e);
  const auto [i, j] = EdgeTable<D>::nodes[edge];
  const std::size_t face = 3 - i - j;
  const FaceRef ref = element.neighbour[face];
  if (ref == no_face || element_of(ref) < e || element.patch[face] != no_patch) return false;
  const std::array<LocalId, 4> around = {element.node[i], element.node[j], element.node[face],
                                         mesh_.element(element_of(ref)).node[local_face(ref)]};
  float gain = 0;  // of the sum of squares; corners have no ideal
  for (std::size_t k = 0; k < around.size(); ++k) {
    if (mesh_.vertex(around[k]).dimension == 0) continue;
    const float now = surplus_[static_cast<std::size_t>(around[k])];
    gain += k < 2 ? 2 * now - 1 : -2 * now - 1;
  }
  if (gain <= 0) return false;
  cavity_.gather_shell(e, edge);
  cavity_.find_border();
  const StarOf star = star_from(around[2]);
  const Real limit = std::max(0.4 * cavity_.worst_key(), limits.balance_key);
  if (cavity_.evaluate(star, limit) <= limit) return false;
  commit(star);
  for (std::size_t k = 0; k < around.size(); ++k) surplus_[static_cast<std::size_t>(around[k])] += k < 2 ? -1.0F : 1.0F;
  ++counts.swaps;
  return true;
}

template <int D, class Metric>
bool Operators<D, Metric>::swap_face(LocalId e, std::size_t face) {
  if (mesh_.element(e).patch[face] != no_patch || !cavity_.gather_pair(e, face)) return false;
  const Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  const Element<D>& element = mesh_.element(e);
  const FaceRef ref = element.neighbour[face];
  const Real limit = worst * limits.swap_gain + 1e-6;
  if (pair_key(element, face, mesh_.element(element_of(ref)).node[local_face(ref)], limit) <= limit) return false;
  cavity_.find_border();
  commit(star_from(element.node[face]));
  ++counts.swaps;
  return true;
}

/// Worst key of the elements around the edge from the apex of a face to the vertex beyond it; <= limit once it is known
/// not to exceed it.
template <int D, class Metric>
Real Operators<D, Metric>::pair_key(const Element<D>& element, std::size_t face, LocalId beyond, Real limit) const {
  PointPointers<D> x = mesh_.points_of(element);
  MetricPointers<D, Metric> m;
  for (std::size_t i = 0; i <= D; ++i) m[i] = &mesh_.metric(element.node[i]);
  Real worst = 2;
  for (std::size_t i = 0; i <= D && worst > limit; ++i) {
    if (i == face) continue;
    const LocalId replaced = element.node[i];
    x[i] = &mesh_.point(beyond);
    m[i] = &mesh_.metric(beyond);
    worst = std::min(worst, shape_key<D>(x, m));
    x[i] = &mesh_.point(replaced);
    m[i] = &mesh_.metric(replaced);
  }
  return worst;
}

template <int D, class Metric>
bool Operators<D, Metric>::swap_at(LocalId e) {
  const auto is_tried = [&](std::size_t bit) { return (mesh_.element(e).tried >> bit & 1U) != 0; };
  for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
    if (!is_tried(edge) && swap_edge(e, edge)) return true;
  }
  for (std::size_t face = 0; D == 3 && face <= D; ++face) {
    if (is_tried(6 + face)) continue;
    if (swap_face(e, face)) return true;
    const FaceRef ref = mesh_.element(e).neighbour[face];
    if (ref == no_face) continue;
    auto& tried = mesh_.element(element_of(ref)).tried;
    tried = static_cast<std::uint16_t>(tried | 1U << (6 + local_face(ref)));
  }
  return false;
}

template class Operators<2, SizeMetric<2>>;
template class Operators<2, TensorMetric<2>>;
template class Operators<3, SizeMetric<3>>;
template class Operators<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
