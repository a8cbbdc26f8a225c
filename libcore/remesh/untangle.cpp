#include "remesh/untangle.hpp"

#include <algorithm>

namespace malleus::remeshing {
namespace {

constexpr int most_rounds = 40;
constexpr int patience = 6;         ///< rounds without fewer bad elements
constexpr Real volume_gain = 1e-9;  ///< relative change of a sum of volumes that counts
constexpr std::size_t largest_ball = 200;

bool is_better(Real volume, Real worst, Real old_volume, Real old_worst) {
  if (volume < old_volume * (1 - volume_gain)) return true;
  return volume <= old_volume * (1 + volume_gain) && worst > old_worst;
}

}  // namespace

template <int D, class Metric>
std::vector<LocalId> Untangler<D, Metric>::bad_elements() const {
  std::vector<LocalId> bad;
  for (std::size_t e = 0; e < mesh_.elements.size(); ++e) {
    if (mesh_.elements[e].is_live() && mesh_.elements[e].key <= 0) bad.push_back(static_cast<LocalId>(e));
  }
  return bad;
}

/// The part of a direction along which v may move.
template <int D, class Metric>
Point<D> Untangler<D, Metric>::confined(LocalId v, const Point<D>& slope) const {
  const Vertex& vertex = mesh_.vertex(v);
  if (vertex.dimension == D) return slope;
  if (vertex.dimension == D - 1) {
    const auto& patch = mesh_.patch(static_cast<std::int16_t>(vertex.entity));
    return patch.flat ? shifted<D>(slope, patch.normal, -dot(slope, patch.normal)) : Point<D>{};
  }
  if constexpr (D == 3) {
    if (vertex.dimension == 1) {
      const Curve& curve = mesh_.curves[static_cast<std::size_t>(vertex.entity)];
      return curve.straight ? shifted<D>({}, curve.tangent, dot(slope, curve.tangent)) : Point<D>{};
    }
  }
  return {};
}

template <int D, class Metric>
bool Untangler<D, Metric>::gather_heights(LocalId v) {
  if (!cavity_.gather_ball(v)) return false;
  heights_.clear();
  for (const LocalId e : cavity_.elements()) {
    const Element<D>& element = mesh_.element(e);
    const auto& face = FaceTable<D>::nodes[element.index_of(v)];
    const Point<D>& origin = mesh_.point(element.node[face[0]]);
    Height height;
    if constexpr (D == 2) {
      const Point<D> edge = difference<D>(mesh_.point(element.node[face[1]]), origin);
      height.slope = {-edge[1], edge[0]};
    } else {
      height.slope = cross(difference<D>(mesh_.point(element.node[face[1]]), origin),
                           difference<D>(mesh_.point(element.node[face[2]]), origin));
    }
    height.area = std::sqrt(dot(height.slope, height.slope));
    if (!(height.area > 0)) return false;
    height.slope = normalized(height.slope);
    height.offset = -dot(height.slope, origin);
    heights_.push_back(height);
  }
  return true;
}

template <int D, class Metric>
typename Untangler<D, Metric>::Measure Untangler<D, Metric>::measure(const Point<D>& x) const {
  Measure result{0, 1e300};
  for (const auto& height : heights_) {
    const Real value = dot(height.slope, x) + height.offset;
    result.volume += std::abs(value) * height.area;
    result.worst = std::min(result.worst, value);
  }
  return result;
}

/// Moves x over the lowest face until all heights reach the margin, or for a while (relaxation after Agmon, Motzkin and
/// Schoenberg 1954); the best place seen.
template <int D, class Metric>
Point<D> Untangler<D, Metric>::raised(LocalId v, const Point<D>& start, Real margin) const {
  Point<D> x = start;
  Point<D> best = start;
  Real best_worst = measure(start).worst;
  for (int step = 0; step < 50; ++step) {
    const Height* lowest = nullptr;
    Real value = 1e300;
    for (const auto& height : heights_) {
      const Real here = dot(height.slope, x) + height.offset;
      if (here >= value) continue;
      value = here;
      lowest = &height;
    }
    if (value > best_worst) {
      best_worst = value;
      best = x;
    }
    if (lowest == nullptr || value >= margin) break;
    const Point<D> along = confined(v, lowest->slope);
    const Real rate = dot(along, lowest->slope);
    if (!(rate > 1e-6)) break;
    x = shifted<D>(x, along, 1.2 * (margin - value) / rate);
  }
  return best;
}

template <int D, class Metric>
bool Untangler<D, Metric>::relax(LocalId v) {
  const Vertex& vertex = mesh_.vertex(v);
  if (vertex.element < 0 || vertex.fixed || vertex.dimension == 0 || !gather_heights(v)) return false;
  const Point<D> start = mesh_.point(v);
  const Measure before = measure(start);
  Real mean = 0;
  for (const auto& height : heights_) mean += std::abs(dot(height.slope, start) + height.offset);
  mean /= static_cast<Real>(heights_.size());
  if (before.worst >= 0.2 * mean) return false;
  Point<D> best = start;
  Measure best_measure = before;
  for (const Real margin : {0.3, 0.1, 0.02}) {
    const Point<D> x = raised(v, start, margin * mean);
    const Measure here = measure(x);
    if (!is_better(here.volume, here.worst, best_measure.volume, best_measure.worst)) continue;
    best = x;
    best_measure = here;
    if (here.worst > 0) break;
  }
  if (best == start) return false;
  mesh_.point(v) = best;
  for (const LocalId e : cavity_.elements())
    mesh_.element(e).key = static_cast<float>(mesh_.key_of_element(mesh_.element(e)));
  return true;
}

/// Relaxes the vertices of bad elements and, with a width, those of the elements around them.
template <int D, class Metric>
void Untangler<D, Metric>::relax_round(const std::vector<LocalId>& bad, int width) {
  std::vector<LocalId> vertices;
  for (const LocalId e : bad) {
    if (!mesh_.element(e).is_live()) continue;
    vertices.insert(vertices.end(), mesh_.element(e).node.begin(), mesh_.element(e).node.end());
  }
  for (int ring = 0; ring < width; ++ring) {
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    const std::vector<LocalId> inner = vertices;
    for (const LocalId v : inner) {
      if (!cavity_.gather_ball(v)) continue;
      for (const LocalId e : cavity_.elements())
        vertices.insert(vertices.end(), mesh_.element(e).node.begin(), mesh_.element(e).node.end());
    }
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  for (const LocalId v : vertices) relax(v);
}

/// Would the star make an edge or a face that exists outside of the cavity?
template <int D, class Metric>
bool Untangler<D, Metric>::breaks_links(const StarOf& star) {
  std::vector<std::uint64_t> old_edges;
  std::vector<LocalId> old_vertices;
  std::vector<std::uint64_t> new_edges;
  std::vector<LocalId> new_vertices;
  for (const LocalId e : cavity_.elements()) {
    const Element<D>& element = mesh_.element(e);
    if (element.has(star.apex)) old_vertices.insert(old_vertices.end(), element.node.begin(), element.node.end());
  }
  for (const auto& face : cavity_.border()) {
    const bool holds_apex = std::find(face.node.begin(), face.node.end(), star.apex) != face.node.end();
    for (std::size_t k = 0; k < D; ++k) {
      const LocalId a = face.node[k];
      const LocalId b = face.node[(k + 1) % D];
      if (holds_apex && (a == star.apex || b == star.apex)) continue;
      (holds_apex ? old_edges : new_edges).push_back(edge_key(a, b));
      if (!holds_apex) new_vertices.push_back(a);
    }
  }
  for (auto* list : {&old_edges, &new_edges}) std::sort(list->begin(), list->end());
  for (auto* list : {&old_vertices, &new_vertices}) std::sort(list->begin(), list->end());
  marks_.resize(mesh_.elements.size(), 0);
  ++stamp_;
  const auto mark = [&](LocalId e) { marks_[static_cast<std::size_t>(e)] = stamp_; };
  const auto is_marked = [&](LocalId e) { return marks_[static_cast<std::size_t>(e)] == stamp_; };
  for (const LocalId e : cavity_.elements()) mark(e);
  std::vector<LocalId> ball;
  for (const auto& face : cavity_.border()) {
    const bool holds_apex = std::find(face.node.begin(), face.node.end(), star.apex) != face.node.end();
    if (!holds_apex || face.outside == no_face || is_marked(element_of(face.outside))) continue;
    mark(element_of(face.outside));
    ball.push_back(element_of(face.outside));
  }
  for (std::size_t n = 0; n < ball.size(); ++n) {
    const Element<D>& element = mesh_.element(ball[n]);
    for (std::size_t i = 0; i <= D; ++i) {
      const LocalId u = element.node[i];
      if (u == star.apex) continue;
      const bool made = std::binary_search(new_vertices.begin(), new_vertices.end(), u);
      if (made && !std::binary_search(old_vertices.begin(), old_vertices.end(), u)) return true;
      for (std::size_t j = 0; D == 3 && j < i; ++j) {
        if (element.node[j] == star.apex) continue;
        const auto key = edge_key(u, element.node[j]);
        if (std::binary_search(new_edges.begin(), new_edges.end(), key) &&
            !std::binary_search(old_edges.begin(), old_edges.end(), key))
          return true;
      }
      const FaceRef ref = element.neighbour[i];
      if (ref == no_face || is_marked(element_of(ref))) continue;
      mark(element_of(ref));
      ball.push_back(element_of(ref));
    }
  }
  return false;
}

/// The star of least sum of |volumes|, then of best worst key, from one of the candidates; carried out if it is better
/// than what the cavity holds.
template <int D, class Metric>
bool Untangler<D, Metric>::best_star(std::span<const LocalId> candidates, LocalId removed) {
  cavity_.find_border();
  if (!cavity_.inner_patches().empty()) return false;
  Real best_volume = cavity_.scaled_volume_sum(true);
  Real best_key = cavity_.worst_key();
  StarOf best;
  for (const LocalId apex : candidates) {
    const StarOf star{apex, {mesh_.point(apex), mesh_.metric(apex), -1, -1}, -1, -1};
    int inverted = 0;
    const Real volume = cavity_.absolute_volume(star, inverted);
    if (volume > best_volume * (1 + volume_gain)) continue;
    const Real key = cavity_.evaluate(star, -2);
    if (!is_better(volume, key, best_volume, best_key) || breaks_links(star)) continue;
    best = star;
    best_volume = volume;
    best_key = key;
  }
  if (best.apex < 0) return false;
  cavity_.commit(best);
  if (removed >= 0) {
    mesh_.vertex(removed).element = -1;
    mesh_.free_vertices.push_back(removed);
  }
  return true;
}

template <int D, class Metric>
bool Untangler<D, Metric>::try_edges(LocalId e) {
  for (std::size_t edge = 0; edge < EdgeTable<D>::size; ++edge) {
    if (!cavity_.gather_shell(e, edge) || !cavity_.is_closed()) continue;
    const std::vector<LocalId> ring(cavity_.ring().begin(), cavity_.ring().end());
    if (best_star(ring, -1)) return true;
  }
  return false;
}

template <int D, class Metric>
bool Untangler<D, Metric>::try_faces(LocalId e) {
  for (std::size_t face = 0; face <= D; ++face) {
    if (mesh_.element(e).patch[face] != no_patch || !cavity_.gather_pair(e, face)) continue;
    const LocalId apex = mesh_.element(e).node[face];
    if (best_star(std::span(&apex, 1), -1)) return true;
  }
  return false;
}

/// Stars of the ball of an inner vertex from the vertices around it, the vertex vanishing.
template <int D, class Metric>
bool Untangler<D, Metric>::try_balls(LocalId e) {
  const auto nodes = mesh_.element(e).node;
  for (const LocalId v : nodes) {
    if (mesh_.vertex(v).dimension < D || mesh_.vertex(v).fixed) continue;
    if (!cavity_.gather_ball(v) || cavity_.elements().size() > largest_ball) continue;
    std::vector<LocalId> around;
    for (const LocalId other : cavity_.elements()) {
      for (const LocalId u : mesh_.element(other).node) {
        if (u != v) around.push_back(u);
      }
    }
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    if (best_star(around, v)) return true;
  }
  return false;
}

/// A flat element with two faces on one flat exterior patch is taken off: its other faces take over.
template <int D, class Metric>
bool Untangler<D, Metric>::remove_flat_border(LocalId e) {
  if constexpr (D == 2) return false;
  const auto& element = mesh_.element(e);
  for (std::size_t edge = 0; edge < EdgeTable<3>::size; ++edge) {
    const auto [i, j] = EdgeTable<3>::nodes[edge];
    const auto [k, l] = EdgeTable<3>::rest[edge];
    const std::int16_t patch = element.patch[k];
    if (patch == no_patch || patch != element.patch[l] || !mesh_.patch(patch).flat) continue;
    if (element.neighbour[k] != no_face || element.neighbour[l] != no_face) continue;
    if (mesh_.curve_of(element.node[i], element.node[j]) >= 0 || mesh_.patch(patch).frozen) continue;
    if (element.neighbour[i] == no_face || element.neighbour[j] == no_face) continue;
    const auto x = mesh_.points_of(element);
    const Real size = squared_distance<D>(*x[0], *x[1]) + squared_distance<D>(*x[2], *x[3]);
    if (std::abs(scaled_volume<D>(x)) > 1e-9 * size * std::sqrt(size)) continue;
    const LocalId apex = element.node[k];
    cavity_.gather_shell(e, edge);
    cavity_.find_border();
    StarOf star{apex, {mesh_.point(apex), mesh_.metric(apex), -1, -1}, element.node[i], element.node[j]};
    cavity_.commit(star);
    return true;
  }
  return false;
}

/// A flat element that hangs on one face alone, its other three on one flat patch, goes with its loose vertex.
template <int D, class Metric>
bool Untangler<D, Metric>::remove_loose(LocalId e) {
  if constexpr (D == 2) return false;
  Element<D>& element = mesh_.element(e);
  std::size_t base = D + 1;
  for (std::size_t f = 0; f <= D; ++f) {
    if (element.neighbour[f] == no_face) continue;
    if (base <= D) return false;
    base = f;
  }
  if (base > D) return false;
  const std::int16_t patch = element.patch[(base + 1) % (D + 1)];
  for (std::size_t f = 0; f <= D; ++f) {
    if (f != base && element.patch[f] != patch) return false;
  }
  Vertex& loose = mesh_.vertex(element.node[base]);
  if (!mesh_.patch(patch).flat || mesh_.patch(patch).frozen || loose.dimension != D - 1 || loose.fixed) return false;
  const FaceRef below = element.neighbour[base];
  mesh_.element(element_of(below)).neighbour[local_face(below)] = no_face;
  mesh_.element(element_of(below)).patch[local_face(below)] = patch;
  for (std::size_t f = 0; f <= D; ++f) mesh_.vertex(element.node[f]).element = element_of(below);
  loose.element = -1;
  mesh_.free_vertices.push_back(element.node[base]);
  element.node[0] = -1;
  mesh_.free_elements.push_back(e);
  return true;
}

template <int D, class Metric>
bool Untangler<D, Metric>::restar(LocalId e) {
  if (!mesh_.element(e).is_live() || mesh_.element(e).key > 0) return false;
  return remove_loose(e) || remove_flat_border(e) || try_faces(e) || try_edges(e) || try_balls(e);
}

template <int D, class Metric>
LocalId Untangler<D, Metric>::run() {
  std::vector<LocalId> bad = bad_elements();
  std::size_t fewest = bad.size();
  int waited = 0;
  for (int round = 0; round < most_rounds && !bad.empty() && waited < patience; ++round) {
    relax_round(bad, std::min(waited, 2));
    for (const LocalId e : bad_elements()) restar(e);
    bad = bad_elements();
    waited = bad.size() < fewest ? 0 : waited + 1;
    fewest = std::min(fewest, bad.size());
  }
  return static_cast<LocalId>(bad.size());
}

template class Untangler<2, SizeMetric<2>>;
template class Untangler<2, TensorMetric<2>>;
template class Untangler<3, SizeMetric<3>>;
template class Untangler<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
