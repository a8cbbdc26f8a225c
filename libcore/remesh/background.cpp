#include "remesh/background.hpp"

namespace malleus::remeshing {

template <int D, class Metric>
Site<D, Metric> Background<D, Metric>::site_on_edge(LocalId a, LocalId b, EntityOf /*entity*/) const {
  Site<D, Metric> site;
  site.position = between<D>(mesh_.point(a), mesh_.point(b), 0.5);
  typename Metric::Log log;
  for (std::size_t i = 0; i < log.size(); ++i) log[i] = 0.5 * (mesh_.metric(a).log[i] + mesh_.metric(b).log[i]);
  site.metric = Metric::from_log(log);
  return site;
}

template <int D, class Metric>
Site<D, Metric> Background<D, Metric>::site_for(LocalId v, const Point<D>& wanted) const {
  const Vertex& vertex = mesh_.vertex(v);
  Site<D, Metric> site{mesh_.point(v), mesh_.metric(v), vertex.input_element, vertex.input_face};
  const Point<D> shift = difference<D>(wanted, site.position);
  if (vertex.dimension == D) {
    site.position = wanted;
  } else if (vertex.dimension == D - 1) {
    const auto& patch = mesh_.patch(static_cast<std::int16_t>(vertex.entity));
    if (patch.flat) site.position = shifted<D>(wanted, patch.normal, -dot(shift, patch.normal));
  } else if constexpr (D == 3) {
    const Curve& curve = mesh_.curves[static_cast<std::size_t>(vertex.entity)];
    if (curve.straight) site.position = shifted<D>(site.position, curve.tangent, dot(shift, curve.tangent));
  }
  return site;
}

template <int D, class Metric>
bool Background<D, Metric>::allows_face(const std::array<Point<D>, D>& /*face*/, std::int16_t patch) const {
  return mesh_.patch(patch).flat;
}

template class Background<2, SizeMetric<2>>;
template class Background<2, TensorMetric<2>>;
template class Background<3, SizeMetric<3>>;
template class Background<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
