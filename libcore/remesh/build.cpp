#include "remesh/build.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>

#include "base/error.hpp"

namespace malleus::remeshing {
namespace {

template <int D>
std::array<LocalId, D> face_nodes(const Element<D>& element, std::size_t face) {
  std::array<LocalId, D> nodes;
  for (std::size_t k = 0; k < D; ++k) nodes[k] = element.node[FaceTable<D>::nodes[face][k]];
  return nodes;
}

/// A face that a third element shares shows as one of three open or paired faces of the same vertices.
template <int D>
void refuse_overused_faces(const std::vector<Element<D>>& elements) {
  std::vector<std::array<LocalId, D>> open;
  for (const auto& element : elements) {
    for (std::size_t f = 0; f <= D; ++f) {
      if (element.neighbour[f] != no_face) continue;
      open.push_back(face_nodes<D>(element, f));
      std::sort(open.back().begin(), open.back().end());
    }
  }
  std::sort(open.begin(), open.end());
  for (const auto& element : elements) {
    for (std::size_t f = 0; f <= D; ++f) {
      if (element.neighbour[f] == no_face) continue;
      auto nodes = face_nodes<D>(element, f);
      std::sort(nodes.begin(), nodes.end());
      if (!std::binary_search(open.begin(), open.end(), nodes)) continue;
      std::string names;
      for (const LocalId v : nodes) names = fmt::format("{} {}", names, v);
      throw InputError(fmt::format("remesh: more than two elements share the face of nodes{}", names));
    }
  }
}

/// Do two neighbours see their common face from opposite sides, as equally oriented simplices do?
template <int D>
bool agree_on_orientation(const Element<D>& a, std::size_t face, const Element<D>& b, std::size_t other) {
  const auto here = face_nodes<D>(a, face);
  const auto there = face_nodes<D>(b, other);
  if constexpr (D == 2) return here[0] == there[1];
  const auto at = static_cast<std::size_t>(std::find(there.begin(), there.end(), here[0]) - there.begin());
  return there[(at + 1) % D] == here[D - 1];
}

/// Exchanges the first two vertices with all that hangs on them.
template <int D>
void mirror(std::vector<Element<D>>& elements, LocalId e) {
  auto& element = elements[static_cast<std::size_t>(e)];
  std::swap(element.node[0], element.node[1]);
  std::swap(element.neighbour[0], element.neighbour[1]);
  for (std::size_t f = 0; f < 2; ++f) {
    const FaceRef ref = element.neighbour[f];
    if (ref != no_face) elements[static_cast<std::size_t>(element_of(ref))].neighbour[local_face(ref)] = face_ref(e, f);
  }
}

/// Orients one face-connected body alike, starting from an element; returns the number of mirrored elements.
template <int D, class Metric>
LocalId orient_body(WorkingMesh<D, Metric>& mesh, LocalId seed, std::vector<char>& seen) {
  std::vector<LocalId> body = {seed};
  LocalId mirrored = 0;
  Real volume = 0;
  seen[static_cast<std::size_t>(seed)] = 1;
  for (std::size_t n = 0; n < body.size(); ++n) {
    const LocalId e = body[n];
    volume += scaled_volume<D>(mesh.points_of(mesh.element(e)));
    for (std::size_t f = 0; f <= D; ++f) {
      const FaceRef ref = mesh.element(e).neighbour[f];
      if (ref == no_face || seen[static_cast<std::size_t>(element_of(ref))]) continue;
      const LocalId other = element_of(ref);
      if (!agree_on_orientation<D>(mesh.element(e), f, mesh.element(other), local_face(ref))) {
        mirror<D>(mesh.elements, other);
        ++mirrored;
      }
      seen[static_cast<std::size_t>(other)] = 1;
      body.push_back(other);
    }
  }
  if (volume >= 0) return mirrored;
  for (const LocalId e : body) mirror<D>(mesh.elements, e);
  return static_cast<LocalId>(body.size()) - mirrored;
}

}  // namespace

template <int D, class Metric>
void build_elements(const RemeshMesh& input, WorkingMesh<D, Metric>& mesh, BuildNotes& notes) {
  const auto n_elements = static_cast<std::size_t>(input.elements());
  mesh.points.resize(static_cast<std::size_t>(input.nodes()));
  mesh.vertices.assign(mesh.points.size(), {});
  for (std::size_t v = 0; v < mesh.points.size(); ++v)
    std::copy_n(input.point(static_cast<LocalId>(v)), D, mesh.points[v].begin());
  mesh.regions.assign(input.element_region.begin(), input.element_region.end());
  std::sort(mesh.regions.begin(), mesh.regions.end());
  mesh.regions.erase(std::unique(mesh.regions.begin(), mesh.regions.end()), mesh.regions.end());
  if (mesh.regions.size() > 32000) throw InputError("remesh: more than 32000 regions");
  mesh.elements.assign(n_elements, {});
  for (std::size_t e = 0; e < n_elements; ++e) {
    Element<D>& element = mesh.elements[e];
    const auto nodes = input.nodes_of_element(static_cast<LocalId>(e));
    std::copy(nodes.begin(), nodes.end(), element.node.begin());
    element.patch.fill(no_patch);
    element.region = static_cast<std::int16_t>(
        std::lower_bound(mesh.regions.begin(), mesh.regions.end(), input.element_region[e]) - mesh.regions.begin());
    for (const LocalId v : element.node) mesh.vertex(v).element = static_cast<LocalId>(e);
  }
  connect_elements<D>(mesh.elements, input.nodes());
  refuse_overused_faces<D>(mesh.elements);
  std::vector<char> seen(n_elements, 0);
  for (std::size_t e = 0; e < n_elements; ++e) {
    if (!seen[e]) notes.reoriented += orient_body(mesh, static_cast<LocalId>(e), seen);
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    mesh.vertices[v].dimension = D;
    mesh.vertices[v].frozen = !input.frozen.empty() && input.frozen[v] != 0;
    mesh.vertices[v].fixed = mesh.vertices[v].frozen;
    mesh.vertices[v].origin = static_cast<LocalId>(v);
    if (mesh.vertices[v].element < 0) ++notes.unused_nodes;
  }
}

namespace {

/// Facets of the output: each patch face once, seen from the side of the smaller element.
template <int D, class Metric>
void write_facets(const WorkingMesh<D, Metric>& mesh, RemeshMesh& output) {
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) {
    const Element<D>& element = mesh.elements[e];
    for (std::size_t f = 0; f <= D; ++f) {
      const FaceRef ref = element.neighbour[f];
      if (element.patch[f] == no_patch || (ref != no_face && element_of(ref) < static_cast<LocalId>(e))) continue;
      const Patch<D>& patch = mesh.patch(element.patch[f]);
      if (!patch.listed) continue;
      // Table faces look inwards; two vertices exchanged make the normal point out of the element.
      auto nodes = face_nodes<D>(element, f);
      std::swap(nodes[0], nodes[1]);
      output.facet_nodes.insert(output.facet_nodes.end(), nodes.begin(), nodes.end());
      output.facet_group.push_back(patch.group);
    }
  }
}

template <int D, class Metric>
void write_curves(const WorkingMesh<D, Metric>& mesh, RemeshMesh& output) {
  const std::map<std::uint64_t, std::int32_t> sorted(mesh.curve_edges.begin(), mesh.curve_edges.end());
  for (const auto& [key, curve] : sorted) {
    output.curve_nodes.push_back(static_cast<LocalId>(key >> 32));
    output.curve_nodes.push_back(static_cast<LocalId>(key & 0xffffffffU));
    output.curve_group.push_back(mesh.curves[static_cast<std::size_t>(curve)].group);
  }
}

}  // namespace

template <int D, class Metric>
RemeshMesh to_arrays(const WorkingMesh<D, Metric>& mesh) {
  RemeshMesh output;
  output.dimension = D;
  output.coordinates.reserve(mesh.points.size() * D);
  for (const auto& x : mesh.points) output.coordinates.insert(output.coordinates.end(), x.begin(), x.end());
  output.element_nodes.reserve(mesh.elements.size() * (D + 1));
  output.element_region.reserve(mesh.elements.size());
  for (const auto& element : mesh.elements) {
    output.element_nodes.insert(output.element_nodes.end(), element.node.begin(), element.node.end());
    output.element_region.push_back(mesh.regions[static_cast<std::size_t>(element.region)]);
  }
  write_facets(mesh, output);
  write_curves(mesh, output);
  bool any_frozen = false;
  output.origin.reserve(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    output.origin.push_back(mesh.vertices[v].origin);
    if (mesh.vertices[v].dimension == 0) output.corners.push_back(static_cast<LocalId>(v));
    any_frozen = any_frozen || mesh.vertices[v].frozen;
  }
  if (any_frozen) {
    output.frozen.reserve(mesh.vertices.size());
    for (const auto& vertex : mesh.vertices) output.frozen.push_back(vertex.frozen ? 1 : 0);
  }
  return output;
}

template void build_elements(const RemeshMesh&, WorkingMesh<2, SizeMetric<2>>&, BuildNotes&);
template void build_elements(const RemeshMesh&, WorkingMesh<2, TensorMetric<2>>&, BuildNotes&);
template void build_elements(const RemeshMesh&, WorkingMesh<3, SizeMetric<3>>&, BuildNotes&);
template void build_elements(const RemeshMesh&, WorkingMesh<3, TensorMetric<3>>&, BuildNotes&);
template RemeshMesh to_arrays(const WorkingMesh<2, SizeMetric<2>>&);
template RemeshMesh to_arrays(const WorkingMesh<2, TensorMetric<2>>&);
template RemeshMesh to_arrays(const WorkingMesh<3, SizeMetric<3>>&);
template RemeshMesh to_arrays(const WorkingMesh<3, TensorMetric<3>>&);

}  // namespace malleus::remeshing
