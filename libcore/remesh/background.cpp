#include "remesh/background.hpp"

#include <algorithm>

namespace malleus::remeshing {
namespace {

/// A face may lean by this much against the input's normal at its centre.
constexpr Real smallest_cosine = 0.8;

/// How far from the middle an edge is split, as a share of it. Edges that are all halved exactly keep the pattern of a
/// structured mesh, in which no single operation gains; the last halving is therefore uneven, by a number drawn from
/// the ends' numbers. More of it betters the mean shape and costs edges that have to be collapsed again.
template <int D>
Real off_centre(LocalId a, LocalId b, Real squared_length) {
  constexpr Real last_halving = 3.0;
  constexpr Real spread = D == 3 ? 0.45 : 0.65;
  const std::uint64_t hash = edge_key(a, b) * 0x9E3779B97F4A7C15ULL;
  const Real drawn = static_cast<Real>(hash >> 40) / static_cast<Real>(1 << 24) - 0.5;
  return (squared_length < last_halving ? spread : 0.1) * drawn;
}

template <int D, class Metric>
Locator<D> locator_of(const WorkingMesh<D, Metric>& mesh) {
  std::vector<typename Locator<D>::Cell> cells(mesh.elements.size());
  for (std::size_t e = 0; e < cells.size(); ++e) {
    const Element<D>& element = mesh.elements[e];
    cells[e].node = element.node;
    for (std::size_t f = 0; f <= D; ++f)
      cells[e].neighbour[f] = element.neighbour[f] == no_face ? -1 : element_of(element.neighbour[f]);
  }
  return {mesh.points, std::move(cells)};
}

}  // namespace

template <int D, class Metric>
Background<D, Metric>::Background(WorkingMesh<D, Metric>& mesh, Real hausdorff, bool varies)
    : mesh_(mesh), hausdorff_(hausdorff) {
  surface_.build(mesh);
  if (!varies) return;
  locator_ = locator_of(mesh);
  logs_.reserve(mesh.metrics.size());
  for (const auto& metric : mesh.metrics) logs_.push_back(metric.log);
  for (auto& vertex : mesh.vertices) vertex.input_element = vertex.element;
}

template <int D, class Metric>
bool Background<D, Metric>::is_curved(EntityOf entity) const {
  if (entity.dimension == D - 1) return !mesh_.patch(static_cast<std::int16_t>(entity.id)).flat;
  return entity.dimension == 1 && !mesh_.curves[static_cast<std::size_t>(entity.id)].straight;
}

template <int D, class Metric>
bool Background<D, Metric>::is_on_curved(LocalId v) const {
  const Vertex& vertex = mesh_.vertex(v);
  if (vertex.dimension == D || vertex.dimension == 0) return false;
  return is_curved({vertex.dimension, vertex.entity});
}

template <int D, class Metric>
LocalId Background<D, Metric>::hint_for(LocalId v, EntityOf entity) const {
  if (D == 2 || entity.dimension == 1) return surface_.segment_hint(mesh_.vertex(v), entity.id);
  return surface_.facet_hint(mesh_.vertex(v), entity.id);
}

template <int D, class Metric>
LocalId Background<D, Metric>::hint(LocalId v, std::int16_t patch) const {
  const Vertex& vertex = mesh_.vertex(v);
  if (vertex.dimension == D || surface_.is_empty()) return -1;
  return hint_for(v, {D - 1, patch});
}

template <int D, class Metric>
SurfacePoint<D> Background<D, Metric>::on_entity(const Point<D>& x, EntityOf entity, LocalId hint) const {
  if (D == 2 || entity.dimension == 1) return surface_.on_curve(x, hint);
  return surface_.on_patch(x, hint);
}

template <int D, class Metric>
void Background<D, Metric>::set_metric(Site<D, Metric>& site) const {
  if (locator_.is_empty()) return;
  const auto hit = locator_.walk(site.position, site.input_element);
  site.input_element = hit.cell;
  const auto& cell = locator_.cells()[static_cast<std::size_t>(hit.cell)];
  typename Metric::Log log{};
  for (std::size_t k = 0; k <= D; ++k) {
    const auto& node = logs_[static_cast<std::size_t>(cell.node[k])];
    for (std::size_t i = 0; i < log.size(); ++i) log[i] += hit.weights[k] * node[i];
  }
  site.metric = Metric::from_log(log);
}

template <int D, class Metric>
Site<D, Metric> Background<D, Metric>::site_on_edge(LocalId a, LocalId b, EntityOf entity, bool straight) const {
  Site<D, Metric> site;
  Real t = 0.5;
  if (!locator_.is_empty()) {
    // Halves of equal metric length, for a size that varies linearly along the edge.
    const Point<D> e = difference<D>(mesh_.point(b), mesh_.point(a));
    const Real ratio = quadratic_form(mesh_.metric(a).tensor(), e) / quadratic_form(mesh_.metric(b).tensor(), e);
    t = std::clamp(1 / (1 + std::sqrt(std::sqrt(ratio))), 0.3, 0.7);
  }
  t += off_centre<D>(a, b, mesh_.squared_length_of(a, b));
  site.position = between<D>(mesh_.point(a), mesh_.point(b), t);
  site.metric = mesh_.metric(a);
  site.input_element = mesh_.vertex(a).input_element;
  if (!surface_.is_empty() && entity.dimension < D) {
    site.input_face = hint_for(a, entity);
    if (site.input_face < 0) site.input_face = hint_for(b, entity);
    if (site.input_face >= 0) {
      const SurfacePoint<D> on = on_entity(site.position, entity, site.input_face);
      site.input_face = on.piece;
      if (is_curved(entity) && !straight) site.position = on.position;
    }
  }
  set_metric(site);
  return site;
}

template <int D, class Metric>
Site<D, Metric> Background<D, Metric>::site_for(LocalId v, const Point<D>& wanted) const {
  const Vertex& vertex = mesh_.vertex(v);
  Site<D, Metric> site{wanted, mesh_.metric(v), vertex.input_element, vertex.input_face};
  const EntityOf entity{vertex.dimension, vertex.entity};
  const Point<D> shift = difference<D>(wanted, mesh_.point(v));
  if (vertex.dimension < D && is_curved(entity)) {
    const SurfacePoint<D> on = on_entity(wanted, entity, vertex.input_face);
    site.position = on.position;
    site.input_face = on.piece;
  } else if (vertex.dimension == D - 1) {
    const auto& normal = mesh_.patch(static_cast<std::int16_t>(vertex.entity)).normal;
    site.position = shifted<D>(wanted, normal, -dot(shift, normal));
  } else if constexpr (D == 3) {
    if (vertex.dimension == 1) {
      const Curve& curve = mesh_.curves[static_cast<std::size_t>(vertex.entity)];
      site.position = shifted<D>(mesh_.point(v), curve.tangent, dot(shift, curve.tangent));
      if (!surface_.is_empty()) site.input_face = surface_.on_curve(site.position, vertex.input_face).piece;
    }
  }
  set_metric(site);
  return site;
}

template <int D, class Metric>
bool Background<D, Metric>::allows_face(const std::array<Point<D>, D>& face, LocalId near) const {
  if (near < 0) return false;
  Point<D> centre{};
  for (const auto& x : face) centre = shifted<D>(centre, x, 1.0 / D);
  if constexpr (D == 2) {
    const SurfacePoint<D> on = surface_.on_curve(centre, near);
    const Point<D> along = normalized(difference<D>(face[1], face[0]));
    return std::abs(dot(along, on.direction)) >= smallest_cosine &&
           (hausdorff_ <= 0 || squared_distance<D>(centre, on.position) <= hausdorff_ * hausdorff_);
  } else {
    const SurfacePoint<D> on = surface_.on_patch(centre, near);
    const Point<D> normal = normalized(cross(difference<D>(face[1], face[0]), difference<D>(face[2], face[0])));
    return std::abs(dot(normal, on.direction)) >= smallest_cosine &&
           (hausdorff_ <= 0 || squared_distance<D>(centre, on.position) <= hausdorff_ * hausdorff_);
  }
}

template <int D, class Metric>
Point<D> Background<D, Metric>::normal_at(LocalId v) const {
  const SurfacePoint<D> on =
      on_entity(mesh_.point(v), {mesh_.vertex(v).dimension, mesh_.vertex(v).entity}, mesh_.vertex(v).input_face);
  if constexpr (D == 2) {
    return {on.direction[1], -on.direction[0]};
  } else {
    return on.direction;
  }
}

template class Background<2, SizeMetric<2>>;
template class Background<2, TensorMetric<2>>;
template class Background<3, SizeMetric<3>>;
template class Background<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
