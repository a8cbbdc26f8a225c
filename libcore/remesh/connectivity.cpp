#include <algorithm>

#include "remesh/working_mesh.hpp"

namespace malleus::remeshing {
namespace {

/// Faces of one element seen so far that no other element has matched, chained by their smallest vertex.
template <int D>
class OpenFaces {
 public:
  explicit OpenFaces(LocalId vertices) : head_(static_cast<std::size_t>(vertices), -1) {}

  /// The open face of the same vertices, taken off the list; no_face (and the face put on the list) if there is none.
  FaceRef match(std::array<LocalId, D> nodes, FaceRef face) {
    std::sort(nodes.begin(), nodes.end());
    LocalId* link = &head_[static_cast<std::size_t>(nodes[0])];
    while (*link >= 0) {
      Entry& entry = entries_[static_cast<std::size_t>(*link)];
      if (std::equal(nodes.begin() + 1, nodes.end(), entry.rest.begin())) {
        const LocalId found = *link;
        *link = entry.next;
        entry.next = free_;
        free_ = found;
        return entry.face;
      }
      link = &entry.next;
    }
    insert(nodes, face);
    return no_face;
  }

 private:
  struct Entry {
    std::array<LocalId, D - 1> rest;
    FaceRef face;
    LocalId next;
  };

  void insert(const std::array<LocalId, D>& nodes, FaceRef face) {
    LocalId slot = free_;
    if (slot >= 0) {
      free_ = entries_[static_cast<std::size_t>(slot)].next;
    } else {
      slot = static_cast<LocalId>(entries_.size());
      entries_.emplace_back();
    }
    Entry& entry = entries_[static_cast<std::size_t>(slot)];
    std::copy(nodes.begin() + 1, nodes.end(), entry.rest.begin());
    entry.face = face;
    entry.next = head_[static_cast<std::size_t>(nodes[0])];
    head_[static_cast<std::size_t>(nodes[0])] = slot;
  }

  std::vector<LocalId> head_;
  std::vector<Entry> entries_;
  LocalId free_ = -1;
};

/// Bits of a cell number with D - 1 zeros between them.
template <int D>
std::uint64_t spread(std::uint32_t cell, int bits) {
  std::uint64_t key = 0;
  for (int b = 0; b < bits; ++b) key |= static_cast<std::uint64_t>((cell >> b) & 1U) << (D * b);
  return key;
}

/// Places along the Morton curve of the live vertices' points.
template <int D, class Metric>
std::vector<std::uint64_t> morton_keys(const WorkingMesh<D, Metric>& mesh, const std::vector<LocalId>& live) {
  constexpr int bits = D == 3 ? 14 : 21;
  Point<D> low;
  low.fill(std::numeric_limits<Real>::max());
  Real side = 0;
  for (const LocalId v : live) {
    for (std::size_t i = 0; i < D; ++i) low[i] = std::min(low[i], mesh.point(v)[i]);
  }
  for (const LocalId v : live) {
    for (std::size_t i = 0; i < D; ++i) side = std::max(side, mesh.point(v)[i] - low[i]);
  }
  const Real scale = side > 0 ? ((1U << bits) - 1) / side : 0;
  std::vector<std::uint64_t> keys(live.size());
  for (std::size_t n = 0; n < live.size(); ++n) {
    for (std::size_t i = 0; i < D; ++i) {
      const auto cell = static_cast<std::uint32_t>((mesh.point(live[n])[i] - low[i]) * scale);
      keys[n] |= spread<D>(cell, bits) << i;
    }
  }
  return keys;
}

/// Sorts the values by their keys (42 bits are enough), equal keys in the order given.
void radix_sort(std::vector<std::uint64_t>& keys, std::vector<LocalId>& values) {
  constexpr int digit_bits = 11;
  constexpr std::size_t buckets = std::size_t{1} << digit_bits;
  std::vector<std::uint64_t> other_keys(keys.size());
  std::vector<LocalId> other_values(values.size());
  for (int shift = 0; shift < 44; shift += digit_bits) {
    std::array<std::size_t, buckets + 1> start{};
    for (const auto key : keys) ++start[((key >> shift) & (buckets - 1)) + 1];
    for (std::size_t b = 0; b < buckets; ++b) start[b + 1] += start[b];
    for (std::size_t n = 0; n < keys.size(); ++n) {
      const std::size_t place = start[(keys[n] >> shift) & (buckets - 1)]++;
      other_keys[place] = keys[n];
      other_values[place] = values[n];
    }
    keys.swap(other_keys);
    values.swap(other_values);
  }
}

/// Live elements ordered by their smallest new vertex number.
template <int D, class Metric>
std::vector<LocalId> element_order(const WorkingMesh<D, Metric>& mesh, const std::vector<LocalId>& new_vertex,
                                   std::size_t vertices) {
  std::vector<LocalId> start(vertices + 1, 0);
  const auto smallest = [&](const Element<D>& element) {
    LocalId low = std::numeric_limits<LocalId>::max();
    for (const LocalId v : element.node) low = std::min(low, new_vertex[static_cast<std::size_t>(v)]);
    return static_cast<std::size_t>(low);
  };
  for (const auto& element : mesh.elements) {
    if (element.is_live()) ++start[smallest(element) + 1];
  }
  for (std::size_t v = 0; v < vertices; ++v) start[v + 1] += start[v];
  std::vector<LocalId> order(static_cast<std::size_t>(start.back()));
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) {
    if (!mesh.elements[e].is_live()) continue;
    order[static_cast<std::size_t>(start[smallest(mesh.elements[e])]++)] = static_cast<LocalId>(e);
  }
  return order;
}

template <int D, class Metric>
void reorder_vertices(WorkingMesh<D, Metric>& mesh, const std::vector<LocalId>& order) {
  std::vector<Point<D>> points(order.size());
  std::vector<Metric> metrics(order.size());
  std::vector<Vertex> vertices(order.size());
  for (std::size_t n = 0; n < order.size(); ++n) {
    points[n] = mesh.point(order[n]);
    metrics[n] = mesh.metric(order[n]);
    vertices[n] = mesh.vertex(order[n]);
  }
  mesh.points.swap(points);
  mesh.metrics.swap(metrics);
  mesh.vertices.swap(vertices);
  mesh.free_vertices.clear();
}

template <int D, class Metric>
void reorder_elements(WorkingMesh<D, Metric>& mesh, const std::vector<LocalId>& order,
                      const std::vector<LocalId>& new_vertex) {
  std::vector<LocalId> new_element(mesh.elements.size(), -1);
  for (std::size_t n = 0; n < order.size(); ++n)
    new_element[static_cast<std::size_t>(order[n])] = static_cast<LocalId>(n);
  std::vector<Element<D>> elements(order.size());
  for (std::size_t n = 0; n < order.size(); ++n) {
    Element<D>& element = elements[n];
    element = mesh.element(order[n]);
    for (std::size_t i = 0; i <= D; ++i) {
      element.node[i] = new_vertex[static_cast<std::size_t>(element.node[i])];
      const FaceRef ref = element.neighbour[i];
      if (ref != no_face)
        element.neighbour[i] = face_ref(new_element[static_cast<std::size_t>(element_of(ref))], local_face(ref));
      mesh.vertex(element.node[i]).element = static_cast<LocalId>(n);
    }
  }
  mesh.elements.swap(elements);
  mesh.free_elements.clear();
}

}  // namespace

template <int D>
void connect_elements(std::vector<Element<D>>& elements, LocalId vertices) {
  OpenFaces<D> open(vertices);
  for (auto& element : elements) element.neighbour.fill(no_face);
  for (std::size_t e = 0; e < elements.size(); ++e) {
    for (std::size_t f = 0; f <= D; ++f) {
      std::array<LocalId, D> nodes;
      for (std::size_t k = 0; k < D; ++k) nodes[k] = elements[e].node[FaceTable<D>::nodes[f][k]];
      const FaceRef here = face_ref(static_cast<LocalId>(e), f);
      const FaceRef there = open.match(nodes, here);
      if (there == no_face) continue;
      elements[e].neighbour[f] = there;
      elements[static_cast<std::size_t>(element_of(there))].neighbour[local_face(there)] = here;
    }
  }
}

template <int D, class Metric>
std::vector<LocalId> renumber(WorkingMesh<D, Metric>& mesh) {
  std::vector<LocalId> live;
  live.reserve(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.vertices[v].element >= 0) live.push_back(static_cast<LocalId>(v));
  }
  std::vector<std::uint64_t> keys = morton_keys(mesh, live);
  radix_sort(keys, live);
  std::vector<LocalId> new_vertex(mesh.vertices.size(), -1);
  for (std::size_t n = 0; n < live.size(); ++n) new_vertex[static_cast<std::size_t>(live[n])] = static_cast<LocalId>(n);
  const std::vector<LocalId> order = element_order(mesh, new_vertex, live.size());
  reorder_vertices(mesh, live);
  reorder_elements(mesh, order, new_vertex);
  std::unordered_map<std::uint64_t, std::int32_t> edges;
  edges.reserve(mesh.curve_edges.size());
  for (const auto& [key, curve] : mesh.curve_edges) {
    const auto low = static_cast<std::size_t>(key >> 32);
    const auto high = static_cast<std::size_t>(key & 0xffffffffU);
    edges.emplace(edge_key(new_vertex[low], new_vertex[high]), curve);
  }
  mesh.curve_edges.swap(edges);
  return new_vertex;
}

template void connect_elements<2>(std::vector<Element<2>>&, LocalId);
template void connect_elements<3>(std::vector<Element<3>>&, LocalId);
template std::vector<LocalId> renumber(WorkingMesh<2, SizeMetric<2>>&);
template std::vector<LocalId> renumber(WorkingMesh<2, TensorMetric<2>>&);
template std::vector<LocalId> renumber(WorkingMesh<3, SizeMetric<3>>&);
template std::vector<LocalId> renumber(WorkingMesh<3, TensorMetric<3>>&);

}  // namespace malleus::remeshing
