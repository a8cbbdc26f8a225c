#include "remesh/volume.hpp"

#include <algorithm>

namespace malleus::remeshing {
namespace {

/// A face of a curved exterior patch, ordered so that its normal looks into the body.
template <int D>
struct FreeFace {
  std::array<LocalId, D> node;
  std::int16_t region;
};

template <int D, class Metric>
std::vector<FreeFace<D>> free_faces(const WorkingMesh<D, Metric>& mesh) {
  std::vector<FreeFace<D>> faces;
  for (const auto& element : mesh.elements) {
    for (std::size_t f = 0; element.is_live() && f <= D; ++f) {
      if (element.patch[f] == no_patch) continue;
      const Patch<D>& patch = mesh.patch(element.patch[f]);
      if (patch.flat || patch.frozen || patch.two_sided) continue;
      FreeFace<D> face;
      for (std::size_t k = 0; k < D; ++k) face.node[k] = element.node[FaceTable<D>::nodes[f][k]];
      face.region = element.region;
      faces.push_back(face);
    }
  }
  return faces;
}

template <int D, class Metric>
Point<D> inward_normal(const WorkingMesh<D, Metric>& mesh, const FreeFace<D>& face) {
  const Point<D>& origin = mesh.point(face.node[0]);
  const Point<D> e = difference<D>(mesh.point(face.node[1]), origin);
  if constexpr (D == 2) {
    return {-e[1], e[0]};
  } else {
    return cross(e, difference<D>(mesh.point(face.node[2]), origin));
  }
}

/// [vertex] those of faces with a vertex inside its patch about which the surface is flat: resampling lost nothing
/// there, and what is flat within a curved patch is pressed flat by something (a tool), which a shift would run into.
/// None where that leaves nothing else.
template <int D, class Metric>
std::vector<char> flat_parts(const WorkingMesh<D, Metric>& mesh, const std::vector<FreeFace<D>>& faces) {
  constexpr Real parallel = 1 - 5e-7;  // cosine of a thousandth
  std::vector<Point<D>> first(mesh.points.size(), Point<D>{});
  std::vector<char> is_flat(mesh.points.size(), 0);
  for (const auto& face : faces) {
    for (const LocalId v : face.node) is_flat[static_cast<std::size_t>(v)] = mesh.vertex(v).dimension == D - 1 ? 1 : 0;
  }
  for (const auto& face : faces) {
    const Point<D> normal = normalized(inward_normal<D, Metric>(mesh, face));
    for (const LocalId v : face.node) {
      Point<D>& known = first[static_cast<std::size_t>(v)];
      if (!(dot(known, known) > 0)) known = normal;
      if (dot(known, normal) < parallel) is_flat[static_cast<std::size_t>(v)] = 0;
    }
  }
  std::vector<char> held(mesh.points.size(), 0);
  bool all = true;
  for (const auto& face : faces) {
    const auto flat = [&](LocalId v) { return is_flat[static_cast<std::size_t>(v)] != 0; };
    const bool any = std::any_of(face.node.begin(), face.node.end(), flat);
    for (const LocalId v : face.node) held[static_cast<std::size_t>(v)] |= static_cast<char>(any);
    all = all && any;
  }
  if (all) std::fill(held.begin(), held.end(), 0);
  return held;
}

/// Derivative of a region's volume with respect to each vertex: minus the inward normals of its faces over D!.
template <int D, class Metric>
void volume_gradients(const WorkingMesh<D, Metric>& mesh, const std::vector<FreeFace<D>>& faces,
                      const std::vector<char>& held, std::int16_t region, std::vector<Point<D>>& gradients) {
  std::fill(gradients.begin(), gradients.end(), Point<D>{});
  for (const auto& face : faces) {
    if (face.region != region) continue;
    const Point<D> inward = inward_normal<D, Metric>(mesh, face);
    for (const LocalId v : face.node) {
      const Vertex& vertex = mesh.vertex(v);
      if (vertex.dimension != D - 1 || vertex.fixed || held[static_cast<std::size_t>(v)] != 0) continue;
      auto& gradient = gradients[static_cast<std::size_t>(v)];
      gradient = shifted<D>(gradient, inward, -1 / factorial<D>);
    }
  }
}

/// One Newton step towards a region's target; false where nothing may move.
template <int D, class Metric>
bool shift_surface(WorkingMesh<D, Metric>& mesh, const std::vector<Point<D>>& gradients, Real missing) {
  Real total = 0;
  for (const auto& gradient : gradients) total += std::sqrt(dot(gradient, gradient));
  if (!(total > 0)) return false;
  const Real shift = missing / total;
  for (std::size_t v = 0; v < gradients.size(); ++v) {
    if (dot(gradients[v], gradients[v]) > 0)
      mesh.points[v] = shifted<D>(mesh.points[v], normalized(gradients[v]), shift);
  }
  return true;
}

}  // namespace

template <int D, class Metric>
std::vector<Real> region_volumes(const WorkingMesh<D, Metric>& mesh) {
  std::vector<Real> volumes(mesh.regions.size(), 0);
  for (const auto& element : mesh.elements) {
    if (element.is_live())
      volumes[static_cast<std::size_t>(element.region)] += scaled_volume<D>(mesh.points_of(element)) / factorial<D>;
  }
  return volumes;
}

template <int D, class Metric>
Real restore_volumes(WorkingMesh<D, Metric>& mesh, const std::vector<Real>& targets) {
  constexpr int most_steps = 6;
  const std::vector<FreeFace<D>> faces = free_faces(mesh);
  const std::vector<char> held = flat_parts<D, Metric>(mesh, faces);
  std::vector<Point<D>> gradients(mesh.points.size());
  const std::vector<Point<D>> before = mesh.points;
  const auto error_of = [&](std::size_t region, Real volume) {
    return std::abs(volume - targets[region]) / std::max(std::abs(targets[region]), 1e-300);
  };
  for (int step = 0; step < most_steps; ++step) {
    const std::vector<Real> volumes = region_volumes(mesh);
    bool moved = false;
    for (std::size_t r = 0; r < targets.size(); ++r) {
      if (error_of(r, volumes[r]) < 1e-15) continue;
      volume_gradients<D, Metric>(mesh, faces, held, static_cast<std::int16_t>(r), gradients);
      moved = shift_surface<D, Metric>(mesh, gradients, targets[r] - volumes[r]) || moved;
    }
    if (!moved) break;
  }
  bool sound = true;
  for (auto& element : mesh.elements) {
    const bool was_positive = element.key > 0;
    if (element.is_live()) element.key = static_cast<float>(mesh.key_of_element(element));
    sound = sound && (element.key > 0 || !was_positive);
  }
  if (!sound) {
    mesh.points = before;
    for (auto& element : mesh.elements) {
      if (element.is_live()) element.key = static_cast<float>(mesh.key_of_element(element));
    }
  }
  Real worst = 0;
  const std::vector<Real> volumes = region_volumes(mesh);
  for (std::size_t r = 0; r < targets.size(); ++r) worst = std::max(worst, error_of(r, volumes[r]));
  return worst;
}

template std::vector<Real> region_volumes(const WorkingMesh<2, SizeMetric<2>>&);
template std::vector<Real> region_volumes(const WorkingMesh<2, TensorMetric<2>>&);
template std::vector<Real> region_volumes(const WorkingMesh<3, SizeMetric<3>>&);
template std::vector<Real> region_volumes(const WorkingMesh<3, TensorMetric<3>>&);
template Real restore_volumes(WorkingMesh<2, SizeMetric<2>>&, const std::vector<Real>&);
template Real restore_volumes(WorkingMesh<2, TensorMetric<2>>&, const std::vector<Real>&);
template Real restore_volumes(WorkingMesh<3, SizeMetric<3>>&, const std::vector<Real>&);
template Real restore_volumes(WorkingMesh<3, TensorMetric<3>>&, const std::vector<Real>&);

}  // namespace malleus::remeshing
