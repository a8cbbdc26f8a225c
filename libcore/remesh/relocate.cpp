#include <algorithm>

#include "remesh/operators.hpp"

namespace malleus::remeshing {
namespace {

/// Height of the regular simplex of unit edges.
template <int D>
constexpr Real unit_height = D == 3 ? 0.81649658092772603 : 0.86602540378443865;

/// Vector normal to a face (edge in 2D), towards the inside.
Point<3> inward_normal(const std::array<Point<3>, 3>& x) {
  return cross(difference<3>(x[1], x[0]), difference<3>(x[2], x[0]));
}
Point<2> inward_normal(const std::array<Point<2>, 2>& x) {
  const Point<2> e = difference<2>(x[1], x[0]);
  return {-e[1], e[0]};
}

template <int D>
Point<D> times(const Symmetric<D>& m, const Point<D>& v) {
  Point<D> result{};
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j < D; ++j) result[static_cast<std::size_t>(i)] += m[packed(i, j)] * v[static_cast<std::size_t>(j)];
  }
  return result;
}

}  // namespace

/// Takes down the faces opposite v of the gathered ball, relative to v's place.
template <int D, class Metric>
void Operators<D, Metric>::note_ball(LocalId v) {
  const Point<D> origin = mesh_.point(v);
  ball_.clear();
  for (const LocalId e : cavity_.elements()) {
    const Element<D>& element = mesh_.element(e);
    const auto& face = FaceTable<D>::nodes[element.index_of(v)];
    std::array<Point<D>, D> x;
    for (std::size_t k = 0; k < D; ++k) x[k] = difference<D>(mesh_.point(element.node[face[k]]), origin);
    ball_.add(x, inward_normal(x), element.key);
  }
}

/// Weighted mean of the places where v would make each element at it regular with unit edges in v's metric; bad
/// elements weigh more. The height over a face with Euclidean normal n is along inv(M) n.
template <int D, class Metric>
Point<D> Operators<D, Metric>::ideal_position(LocalId v) const {
  const auto inverse = mesh_.metric(v).inverse();
  Point<D> sum{};
  Real weights = 0;
  for (const auto& spoke : ball_.spokes()) {
    Point<D> along = spoke.normal;
    if constexpr (Metric::is_tensor) along = times<D>(inverse, spoke.normal);
    const Real squares = Metric::is_tensor ? 1 / dot(spoke.normal, along) : inverse[0] / dot(along, along);
    const Real height = unit_height<D> * std::sqrt(squares);
    const Real root = 0.05 + std::max(0.0F, spoke.key);
    const Real weight = 1 / (root * root);
    weights += weight;
    for (std::size_t i = 0; i < D; ++i) sum[i] += weight * (spoke.sum[i] / D + height * along[i]);
  }
  return shifted<D>(mesh_.point(v), sum, 1 / weights);
}

/// Are the faces that curved patches have at v near the input surface?
template <int D, class Metric>
bool Operators<D, Metric>::ball_stays_close(LocalId v) const {
  if (mesh_.vertex(v).dimension == D || !background_.is_on_curved(v)) return true;
  for (const LocalId e : cavity_.elements()) {
    const Element<D>& element = mesh_.element(e);
    for (std::size_t f = 0; f <= D; ++f) {
      if (element.patch[f] == no_patch || element.node[f] == v || mesh_.patch(element.patch[f]).flat) continue;
      std::array<Point<D>, D> points;
      for (std::size_t k = 0; k < D; ++k) points[k] = mesh_.point(element.node[FaceTable<D>::nodes[f][k]]);
      if (!background_.allows_face(points, background_.hint(v, element.patch[f]))) return false;
    }
  }
  return true;
}

/// Moves v there if the worst key of its elements gains, or stays while their sum gains.
template <int D, class Metric>
bool Operators<D, Metric>::try_site(LocalId v, const Site<D, Metric>& site, Real worst, Real total) {
  const auto gains = [&](Real new_worst, Real new_total) {
    return new_worst > 1.0005 * worst || (new_worst >= 0.999 * worst && new_total > 1.001 * total);
  };
  return put_at(v, site, 0.9 * worst, gains);
}

/// Moves v there if the worst key of its elements gains a hundredth, and takes it over.
template <int D, class Metric>
bool Operators<D, Metric>::raise_worst(LocalId v, const Site<D, Metric>& site, Real& worst) {
  Real reached = worst;
  const auto gains = [&](Real now, Real) {
    reached = now;
    return now > 1.01 * worst;
  };
  if (!put_at(v, site, worst, gains)) return false;
  worst = reached;
  return true;
}

/// Vertices that were put on a chord of the surface are brought onto it as soon as their elements stand it.
template <int D, class Metric>
bool Operators<D, Metric>::return_to_surface(LocalId v, Real worst) {
  const Site<D, Metric> site = background_.site_for(v, mesh_.point(v));
  if (squared_length<D>(mesh_.point(v), mesh_.metric(v), site.position, site.metric) < 1e-8) return false;
  return put_at(v, site, 0.3 * worst, [](Real, Real) { return true; });
}

/// Puts v there if no key falls to the floor, faces stay close to the surface, and accept(worst key, sum of keys)
/// holds.
template <int D, class Metric>
template <class Accept>
bool Operators<D, Metric>::put_at(LocalId v, const Site<D, Metric>& site, Real floor, Accept&& accept) {
  const Point<D> old_point = mesh_.point(v);
  const Metric old_metric = mesh_.metric(v);
  const Point<D> shift = difference<D>(site.position, old_point);
  mesh_.point(v) = site.position;
  mesh_.metric(v) = site.metric;
  const auto elements = cavity_.elements();
  keys_.resize(elements.size());
  Real new_worst = 2;
  Real new_total = 0;
  for (std::size_t n = 0; n < elements.size() && new_worst > floor; ++n) {
    Real key = 0;
    if constexpr (Metric::is_tensor) {
      key = mesh_.key_of_element(mesh_.element(elements[n]));
    } else {
      key = ball_.key(n, shift);
    }
    keys_[n] = static_cast<float>(key);
    new_worst = std::min(new_worst, key);
    new_total += key;
  }
  const bool better = new_worst > floor && accept(new_worst, new_total);
  if (!better || !ball_stays_close(v)) {
    mesh_.point(v) = old_point;
    mesh_.metric(v) = old_metric;
    return false;
  }
  mesh_.vertex(v).input_element = site.input_element;
  mesh_.vertex(v).input_face = site.input_face;
  note_changes();
  return true;
}

/// Takes over the new keys of the ball; elements and vertices whose surroundings changed enough to matter go on the
/// lists.
template <int D, class Metric>
void Operators<D, Metric>::note_changes() {
  const auto elements = cavity_.elements();
  float largest = 0;
  for (std::size_t n = 0; n < elements.size(); ++n) {
    Element<D>& element = mesh_.element(elements[n]);
    largest = std::max(largest, std::abs(keys_[n] - element.key) / std::max(element.key, 1e-6F));
    element.key = keys_[n];
  }
  if (largest < limits.small_change) return;
  for (const LocalId e : elements) {
    mesh_.element(e).tried = 0;
    enlist(e, pending::swap | pending::length);
    if (largest < limits.large_change) continue;
    for (const LocalId u : mesh_.element(e).node) enlist_vertex(u);
  }
}

template <int D, class Metric>
bool Operators<D, Metric>::relocate(LocalId v) {
  if (mesh_.vertex(v).fixed || mesh_.vertex(v).dimension == 0 || !cavity_.gather_ball(v)) return false;
  note_ball(v);
  Real worst = 2;
  Real total = 0;
  for (const auto& spoke : ball_.spokes()) {
    worst = std::min<Real>(worst, spoke.key);
    total += spoke.key;
  }
  if (worst <= 0) return false;
  if (background_.is_on_curved(v) && return_to_surface(v, worst)) {
    enlist_vertex(v);
    ++counts.moves;
    return true;
  }
  const Point<D> from = mesh_.point(v);
  const Point<D> wanted = ideal_position(v);
  Real step = 1;
  for (int attempt = 0; attempt < 3; ++attempt, step *= 0.5) {
    const Site<D, Metric> site = background_.site_for(v, between<D>(from, wanted, step));
    if (!try_site(v, site, worst, total)) continue;
    ++counts.moves;
    return true;
  }
  return false;
}

template class Operators<2, SizeMetric<2>>;
template class Operators<2, TensorMetric<2>>;
template class Operators<3, SizeMetric<3>>;
template class Operators<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
