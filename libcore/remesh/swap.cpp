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

template <int D, class Metric>
bool Operators<D, Metric>::swap_edge(LocalId e, std::size_t edge) {
  const LocalId a = mesh_.element(e).node[EdgeTable<D>::nodes[edge][0]];
  const LocalId b = mesh_.element(e).node[EdgeTable<D>::nodes[edge][1]];
  const bool both_on_boundary = mesh_.vertex(a).dimension < D && mesh_.vertex(b).dimension < D;
  if (both_on_boundary && mesh_.curve_of(a, b) >= 0) return false;
  if (!cavity_.gather_shell(e, edge) || cavity_.ring().size() > largest_ring) return false;
  const Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  cavity_.find_border();
  if (!cavity_.is_closed() || !cavity_.inner_patches().empty()) return D == 3 && swap_patch_edge(a, b, worst);
  Real best = worst * limits.swap_gain + 1e-6;
  StarOf found;
  const auto ring = cavity_.ring();
  const std::size_t candidates = ring.size() <= 3 ? 1 : ring.size();
  for (std::size_t n = 0; n < candidates; ++n) {
    const StarOf star = star_from(ring[n]);
    const Real key = cavity_.evaluate(star, best);
    if (key <= best) continue;
    best = key;
    found = star;
  }
  if (found.apex < 0) return false;
  commit(found);
  ++counts.swaps;
  return true;
}

/// Triangles at a vertex beyond the ideal number; 0 where there is none (corners).
template <int D, class Metric>
int Operators<D, Metric>::surplus(LocalId v) {
  const int dimension = mesh_.vertex(v).dimension;
  if (dimension == 0 || !cavity_.gather_ball(v)) return 0;
  return static_cast<int>(cavity_.elements().size()) - (cavity_.is_closed() ? 6 : 3);
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
  int before = 0;
  int after = 0;
  for (std::size_t k = 0; k < around.size(); ++k) {
    const int now = surplus(around[k]);
    const int then = mesh_.vertex(around[k]).dimension == 0 ? 0 : now + (k < 2 ? -1 : 1);
    before += now * now;
    after += then * then;
  }
  if (after >= before) return false;
  cavity_.gather_shell(e, edge);
  cavity_.find_border();
  const StarOf star = star_from(around[2]);
  const Real limit = std::max(0.4 * cavity_.worst_key(), limits.balance_key);
  if (cavity_.evaluate(star, limit) <= limit) return false;
  commit(star);
  ++counts.swaps;
  return true;
}

template <int D, class Metric>
bool Operators<D, Metric>::swap_face(LocalId e, std::size_t face) {
  if (mesh_.element(e).patch[face] != no_patch || !cavity_.gather_pair(e, face)) return false;
  const Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  cavity_.find_border();
  const StarOf star = star_from(mesh_.element(e).node[face]);
  const Real limit = worst * limits.swap_gain + 1e-6;
  if (cavity_.evaluate(star, limit) <= limit) return false;
  commit(star);
  ++counts.swaps;
  return true;
}

template <int D, class Metric>
bool Operators<D, Metric>::swap_at(LocalId e) {
  for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
    if (swap_edge(e, edge)) return true;
  }
  for (std::size_t face = 0; D == 3 && face <= D; ++face) {
    if (swap_face(e, face)) return true;
  }
  return false;
}

template class Operators<2, SizeMetric<2>>;
template class Operators<2, TensorMetric<2>>;
template class Operators<3, SizeMetric<3>>;
template class Operators<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
