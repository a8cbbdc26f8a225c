#include <algorithm>

#include "remesh/operators.hpp"

namespace malleus::remeshing {
namespace {
constexpr Real least_gain = 1.01;  ///< of the worst key
}

/// Looks for a better place by steps along the spokes to the vertices around, ever shorter: they have the metric's
/// proportions. try_place(x) takes x over and returns true if it is better.
template <int D, class Metric>
template <class Try>
bool Operators<D, Metric>::search_place(Point<D> start, std::span<const LocalId> around, Try&& try_place) const {
  bool found = false;
  for (const Real step : {0.2, 0.1, 0.05, 0.02}) {
    bool again = true;
    for (int sweep = 0; again && sweep < 4; ++sweep) {
      again = false;
      for (const LocalId u : around) {
        for (const Real share : {step, -step}) {
          const Point<D> x = between<D>(start, mesh_.point(u), share);
          if (!try_place(x)) continue;
          start = x;
          again = true;
          break;
        }
      }
      found = found || again;
    }
  }
  return found;
}

/// The vertices of the gathered elements but one.
template <int D, class Metric>
void Operators<D, Metric>::find_around(LocalId but, std::vector<LocalId>& around) {
  around.clear();
  cavity_.new_vertex_marks();
  if (but >= 0) cavity_.mark_vertex(but);
  for (const LocalId e : cavity_.elements()) {
    for (const LocalId u : mesh_.element(e).node) {
      if (cavity_.is_marked(u)) continue;
      cavity_.mark_vertex(u);
      around.push_back(u);
    }
  }
}

template <int D, class Metric>
bool Operators<D, Metric>::optimise(LocalId v) {
  if (mesh_.vertex(v).fixed || mesh_.vertex(v).dimension == 0 || !cavity_.gather_ball(v)) return false;
  Real worst = cavity_.worst_key();
  if (worst <= 0) return false;
  find_around(v, around_);
  note_ball(v);
  const auto try_place = [&](const Point<D>& x) {
    if (!raise_worst(v, background_.site_for(v, x), worst)) return false;
    note_ball(v);
    return true;
  };
  if (!search_place(mesh_.point(v), around_, try_place)) return false;
  ++counts.moves;
  return true;
}

/// Stars the shell of an inner edge from a new point near its middle where that betters its worst key.
template <int D, class Metric>
bool Operators<D, Metric>::insert_at(LocalId e, std::size_t edge) {
  const auto [a, b] = mesh_.ends(e, edge);
  if (!cavity_.gather_shell(e, edge) || !cavity_.is_closed() || cavity_.has_inner_patch()) return false;
  const Real old = cavity_.worst_key();
  if (old <= 0) return false;
  cavity_.find_border();
  find_around(-1, around_);
  const EntityOf inside{D, -1};
  StarOf star{-1, background_.site_on_edge(a, b, inside), a, b};
  Real worst = cavity_.evaluate(star, -1);
  const auto try_place = [&](const Point<D>& x) {
    StarOf moved = star;
    background_.move_site(moved.site, x);
    const Real now = cavity_.evaluate(moved, worst);
    if (now <= least_gain * std::max<Real>(worst, 0)) return false;
    star = moved;
    worst = now;
    return true;
  };
  search_place(star.site.position, around_, try_place);
  return worst > 1.2 * old && split_at(star, inside, a, b);
}

template <int D, class Metric>
bool Operators<D, Metric>::mend(LocalId e) {
  const float key = mesh_.element(e).key;
  const auto is_better = [&] { return !mesh_.element(e).is_live() || mesh_.element(e).key > key; };
  const auto nodes = mesh_.element(e).node;
  mesh_.element(e).tried = 0;
  if (swap_at(e)) return true;
  for (const LocalId v : nodes) {
    if (optimise(v) && is_better()) return true;
  }
  for (const auto& [i, j] : EdgeTable<D>::nodes) {
    if (collapse(nodes[i], nodes[j]) || collapse(nodes[j], nodes[i])) return true;
  }
  for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
    if (insert_at(e, edge)) return true;
  }
  return false;
}

template class Operators<2, SizeMetric<2>>;
template class Operators<2, TensorMetric<2>>;
template class Operators<3, SizeMetric<3>>;
template class Operators<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
