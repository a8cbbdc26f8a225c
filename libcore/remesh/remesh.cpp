#include "remesh/remesh.hpp"

#include <ctime>
#include <numbers>

#include "remesh/build.hpp"
#include "remesh/remesher.hpp"
#include "remesh/volume.hpp"

namespace malleus {
namespace {

using namespace remeshing;

template <int D, class VertexMetric>
void set_metrics(const Metric& metric, WorkingMesh<D, VertexMetric>& mesh) {
  mesh.metrics.resize(mesh.points.size());
  const auto& values = metric.values();
  for (std::size_t v = 0; v < mesh.metrics.size(); ++v) {
    if constexpr (VertexMetric::is_tensor) {
      const auto n = static_cast<std::size_t>(symmetric_size<D>);
      mesh.metrics[v] = VertexMetric::from_metric(std::span(values).subspan(v * n, n));
    } else {
      const Real size = metric.kind() == Metric::Kind::uniform ? values[0] : values[v];
      const Real inverse_square = 1 / (size * size);
      mesh.metrics[v] = VertexMetric::from_metric(std::span(&inverse_square, 1));
    }
  }
}

template <int D, class VertexMetric>
Metric metric_of(const WorkingMesh<D, VertexMetric>& mesh, const Metric& input) {
  if (input.kind() == Metric::Kind::uniform) return input;
  std::vector<Real> values;
  for (const auto& metric : mesh.metrics) {
    if constexpr (VertexMetric::is_tensor) {
      values.insert(values.end(), metric.metric.begin(), metric.metric.end());
    } else {
      values.push_back(1 / metric.inverse_size);
    }
  }
  if constexpr (VertexMetric::is_tensor) return Metric::tensors(D, std::move(values));
  return Metric::per_node(std::move(values));
}

/// Takes all patches with their vertices out of what may change.
template <int D, class VertexMetric>
void fix_surface(WorkingMesh<D, VertexMetric>& mesh) {
  for (auto& patch : mesh.patches) patch.frozen = true;
  for (auto& vertex : mesh.vertices) vertex.fixed = vertex.fixed || vertex.dimension < D;
}

/// Marks the vertices of curved free surfaces, where edges are wanted shorter.
template <int D, class VertexMetric>
void refine_curved(Real finer, WorkingMesh<D, VertexMetric>& mesh) {
  mesh.bulging_factor = finer * finer;
  if (!(finer > 1)) return;
  for (const auto& element : mesh.elements) {
    for (std::size_t f = 0; f <= D; ++f) {
      if (element.patch[f] == no_patch) continue;
      const Patch<D>& patch = mesh.patch(element.patch[f]);
      if (patch.flat || patch.frozen || patch.two_sided) continue;
      for (const std::size_t k : FaceTable<D>::nodes[f]) mesh.vertex(element.node[k]).bulges = true;
    }
  }
}

template <int D, class VertexMetric>
void set_keys(WorkingMesh<D, VertexMetric>& mesh) {
  for (auto& element : mesh.elements) element.key = static_cast<float>(mesh.key_of_element(element));
}

template <int D, class VertexMetric>
RemeshReport remesh_with(RemeshMesh& input, const Metric& metric, const RemeshOptions& options, Metric* carried) {
  const auto start = std::clock();
  RemeshReport report;
  WorkingMesh<D, VertexMetric> mesh;
  BuildNotes notes;
  build_elements(input, mesh, notes);
  set_metrics(metric, mesh);
  classify(input, options.feature_angle * std::numbers::pi / 180, mesh, notes);
  if (options.keep_surface) fix_surface(mesh);
  refine_curved(options.surface_finer, mesh);
  set_keys(mesh);
  report.nodes_before = input.nodes();
  report.elements_before = input.elements();
  report.volume_before = signed_volume(input);
  report.unmatched_facets = notes.unmatched_facets;
  report.unused_nodes = notes.unused_nodes;
  input = {};
  report.before = assess(mesh);
  const std::vector<Real> volumes = region_volumes(mesh);
  renumber(mesh);
  const Background<D, VertexMetric> background(mesh, options.hausdorff, metric.kind() != Metric::Kind::uniform);
  report.phases.push_back({"build", static_cast<Real>(std::clock() - start) / CLOCKS_PER_SEC});
  Remesher<D, VertexMetric>(mesh, background, options).run(report);
  const auto finish = std::clock();
  if (options.keep_volume) report.volume_error = restore_volumes(mesh, volumes);
  report.after = assess(mesh);
  input = to_arrays(mesh);
  if (carried != nullptr) *carried = metric_of(mesh, metric);
  report.nodes_after = input.nodes();
  report.elements_after = input.elements();
  report.volume_after = signed_volume(input);
  report.phases.push_back({"report", static_cast<Real>(std::clock() - finish) / CLOCKS_PER_SEC});
  return report;
}

}  // namespace

RemeshReport remesh(RemeshMesh& mesh, const Metric& metric, const RemeshOptions& options, Metric* carried) {
  check_arrays(mesh);
  check_metric(mesh, metric);
  const bool tensors = metric.kind() == Metric::Kind::tensors;
  if (mesh.dimension == 2)
    return tensors ? remesh_with<2, TensorMetric<2>>(mesh, metric, options, carried)
                   : remesh_with<2, SizeMetric<2>>(mesh, metric, options, carried);
  return tensors ? remesh_with<3, TensorMetric<3>>(mesh, metric, options, carried)
                 : remesh_with<3, SizeMetric<3>>(mesh, metric, options, carried);
}

}  // namespace malleus
