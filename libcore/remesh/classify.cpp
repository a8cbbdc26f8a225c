#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>

#include "base/error.hpp"
#include "remesh/build.hpp"

namespace malleus::remeshing {
namespace {

/// One face that lies on the boundary, on an interface, or on a listed inner surface.
template <int D>
struct SurfaceFace {
  std::array<LocalId, D> node;
  FaceRef ref;        ///< seen from one side
  std::int32_t kind;  ///< faces of different kinds never share a patch
};

/// What makes faces belong together: group, the regions on both sides, frozen or not.
struct Kind {
  std::int32_t group = -1;
  std::int32_t low_region = -1;
  std::int32_t high_region = -1;
  bool frozen = false;
  bool listed = false;
  auto tied() const { return std::tie(group, low_region, high_region, frozen, listed); }
  bool operator<(const Kind& other) const { return tied() < other.tied(); }
};

/// The listed facets, found by their nodes.
template <int D>
class ListedFacets {
 public:
  explicit ListedFacets(const RemeshMesh& input)
      : input_(input), by_node_(static_cast<std::size_t>(input.nodes()), -1) {
    next_.assign(static_cast<std::size_t>(input.facets()), -1);
    used_.assign(next_.size(), 0);
    for (LocalId f = 0; f < input.facets(); ++f) {
      LocalId& head = by_node_[static_cast<std::size_t>(sorted(f)[0])];
      next_[static_cast<std::size_t>(f)] = head;
      head = f;
    }
  }
  /// Index of the facet of these nodes, -1 if it is not listed.
  LocalId find(std::array<LocalId, D> nodes) {
    std::sort(nodes.begin(), nodes.end());
    LocalId f = by_node_[static_cast<std::size_t>(nodes[0])];
    while (f >= 0 && sorted(f) != nodes) f = next_[static_cast<std::size_t>(f)];
    if (f >= 0) used_[static_cast<std::size_t>(f)] = 1;
    return f;
  }
  LocalId count_unused() const { return static_cast<LocalId>(std::count(used_.begin(), used_.end(), 0)); }

 private:
  std::array<LocalId, D> sorted(LocalId f) const {
    std::array<LocalId, D> nodes;
    std::copy_n(input_.facet_nodes.begin() + static_cast<std::ptrdiff_t>(f) * D, D, nodes.begin());
    std::sort(nodes.begin(), nodes.end());
    return nodes;
  }
  const RemeshMesh& input_;
  std::vector<LocalId> by_node_;
  std::vector<LocalId> next_;
  std::vector<char> used_;
};

template <int D, class Metric>
class Classifier {
 public:
  Classifier(const RemeshMesh& input, Real feature_angle, WorkingMesh<D, Metric>& mesh)
      : input_(input), straight_(std::cos(feature_angle)), mesh_(mesh) {}

  LocalId run() {
    const LocalId unused = find_faces();
    join_faces();
    number_patches();
    class_vertices();
    find_flat_patches();
    if constexpr (D == 3) number_curves();
    return unused;
  }

 private:
  /// An edge (3D) or vertex (2D) of a surface face.
  struct Rim {
    std::uint64_t key;
    LocalId face;
    bool operator<(const Rim& other) const { return std::tie(key, face) < std::tie(other.key, other.face); }
  };

  struct Feature {
    std::uint64_t key;   ///< of the rim
    std::int32_t group;  ///< of the curve
    bool locked;         ///< more than one fan of elements ends there
  };

  LocalId find_faces() {
    ListedFacets<D> listed(input_);
    std::map<Kind, std::int32_t> numbers;
    for (std::size_t e = 0; e < mesh_.elements.size(); ++e) {
      const Element<D>& element = mesh_.elements[e];
      for (std::size_t f = 0; f <= D; ++f) {
        const FaceRef other = element.neighbour[f];
        if (other != no_face && element_of(other) < static_cast<LocalId>(e)) continue;
        std::array<LocalId, D> nodes;
        for (std::size_t k = 0; k < D; ++k) nodes[k] = element.node[FaceTable<D>::nodes[f][k]];
        const LocalId facet = listed.find(nodes);
        Kind kind;
        if (!describe(element, other, nodes, facet, kind)) continue;
        const auto number = numbers.emplace(kind, static_cast<std::int32_t>(numbers.size())).first->second;
        if (static_cast<std::size_t>(number) == kinds_.size()) kinds_.push_back(kind);
        faces_.push_back({nodes, face_ref(static_cast<LocalId>(e), f), number});
      }
    }
    return listed.count_unused();
  }

  /// The kind of a face; false where it is an ordinary inner face.
  bool describe(const Element<D>& element, FaceRef other, const std::array<LocalId, D>& nodes, LocalId facet,
                Kind& kind) const {
    const std::int32_t across = other == no_face ? -1 : mesh_.element(element_of(other)).region;
    if (facet < 0 && across == element.region) return false;
    kind.low_region = std::min<std::int32_t>(element.region, across);
    kind.high_region = std::max<std::int32_t>(element.region, across);
    kind.listed = facet >= 0;
    if (facet >= 0) kind.group = input_.facet_group[static_cast<std::size_t>(facet)];
    kind.frozen = facet < 0 && other == no_face &&
                  std::all_of(nodes.begin(), nodes.end(), [&](LocalId v) { return mesh_.vertex(v).frozen; });
    return true;
  }

  LocalId find(LocalId face) {
    while (parent_[static_cast<std::size_t>(face)] != face) {
      LocalId& up = parent_[static_cast<std::size_t>(face)];
      up = parent_[static_cast<std::size_t>(up)];
      face = up;
    }
    return face;
  }

  std::vector<Rim> sorted_rims() const {
    std::vector<Rim> rims;
    rims.reserve(faces_.size() * D);
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      for (std::size_t k = 0; k < D; ++k) {
        const auto& node = faces_[f].node;
        const std::uint64_t key = D == 3 ? edge_key(node[k], node[(k + 1) % D]) : static_cast<std::uint64_t>(node[k]);
        rims.push_back({key, static_cast<LocalId>(f)});
      }
    }
    std::sort(rims.begin(), rims.end());
    return rims;
  }

  /// Joins faces across smooth rims; the others become feature edges (3D) or corners (2D).
  void join_faces() {
    parent_.resize(faces_.size());
    std::iota(parent_.begin(), parent_.end(), 0);
    std::map<std::uint64_t, std::int32_t> listed;
    for (LocalId c = 0; c < input_.curves(); ++c) {
      const auto at = static_cast<std::size_t>(2 * c);
      listed.emplace(edge_key(input_.curve_nodes[at], input_.curve_nodes[at + 1]),
                     input_.curve_group[static_cast<std::size_t>(c)]);
    }
    const std::vector<Rim> rims = sorted_rims();
    for (std::size_t first = 0, last = 0; first < rims.size(); first = last) {
      while (last < rims.size() && rims[last].key == rims[first].key) ++last;
      const auto curve = D == 3 ? listed.find(rims[first].key) : listed.end();
      const bool smooth = last - first == 2 && curve == listed.end() && joins(rims[first], rims[first + 1]);
      if (smooth) {
        const LocalId a = find(rims[first].face);
        const LocalId b = find(rims[first + 1].face);
        parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
      } else {
        features_.push_back({rims[first].key, curve == listed.end() ? -1 : curve->second,
                             count_exterior(std::span(rims).subspan(first, last - first)) > 2});
      }
    }
  }

  std::size_t count_exterior(std::span<const Rim> rims) const {
    return static_cast<std::size_t>(std::count_if(rims.begin(), rims.end(), [&](const Rim& rim) {
      const FaceRef ref = faces_[static_cast<std::size_t>(rim.face)].ref;
      return mesh_.element(element_of(ref)).neighbour[local_face(ref)] == no_face;
    }));
  }

  bool joins(const Rim& a, const Rim& b) const {
    const auto& fa = faces_[static_cast<std::size_t>(a.face)];
    const auto& fb = faces_[static_cast<std::size_t>(b.face)];
    if (fa.kind != fb.kind) return false;
    if (kinds_[static_cast<std::size_t>(fa.kind)].frozen) return true;
    return -dot(inward(fa, a.key), inward(fb, b.key)) >= straight_;
  }

  /// Unit vector from a rim into its face.
  Point<D> inward(const SurfaceFace<D>& face, std::uint64_t key) const {
    const auto low = static_cast<LocalId>(D == 3 ? key >> 32 : key);
    const auto high = static_cast<LocalId>(D == 3 ? key & 0xffffffffU : key);
    LocalId apex = face.node[0];
    for (const LocalId v : face.node) {
      if (v != low && v != high) apex = v;
    }
    Point<D> inside = difference<D>(mesh_.point(apex), mesh_.point(low));
    if constexpr (D == 3) {
      const Point<D> along = normalized(difference<D>(mesh_.point(high), mesh_.point(low)));
      inside = shifted<D>(inside, along, -dot(inside, along));
    }
    return normalized(inside);
  }

  void number_patches() {
    std::vector<std::int32_t> number(faces_.size(), -1);
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      auto& patch = number[static_cast<std::size_t>(find(static_cast<LocalId>(f)))];
      const Kind& kind = kinds_[static_cast<std::size_t>(faces_[f].kind)];
      if (patch < 0) {
        patch = static_cast<std::int32_t>(mesh_.patches.size());
        mesh_.patches.push_back({kind.group, kind.frozen, true, kind.listed, {}, kind.low_region >= 0});
      }
      const auto id = static_cast<std::int16_t>(patch);
      Element<D>& element = mesh_.element(element_of(faces_[f].ref));
      const std::size_t local = local_face(faces_[f].ref);
      element.patch[local] = id;
      if (const FaceRef other = element.neighbour[local]; other != no_face)
        mesh_.element(element_of(other)).patch[local_face(other)] = id;
    }
    if (mesh_.patches.size() > 32000)
      throw InputError(
          fmt::format("remesh: the surface falls into {} smooth pieces, more than 32000: raise the feature "
                      "angle, or smooth the surface",
                      mesh_.patches.size()));
  }

  void class_vertices() {
    for (const auto& face : faces_) {
      for (const LocalId v : face.node) {
        mesh_.vertex(v).dimension = D - 1;
        mesh_.vertex(v).entity = mesh_.element(element_of(face.ref)).patch[local_face(face.ref)];
      }
    }
    if constexpr (D == 2) {
      for (const auto& feature : features_) make_corner(static_cast<LocalId>(feature.key));
    } else {
      class_curve_vertices();
    }
    for (const LocalId v : input_.corners) make_corner(v);
    find_pinched_vertices();
  }

  void make_corner(LocalId v) {
    mesh_.vertex(v).dimension = 0;
    mesh_.vertex(v).entity = -1;
  }

  /// Vertices on exactly two feature edges of one group that continue each other lie on a curve, others are corners.
  void class_curve_vertices() {
    std::vector<std::pair<LocalId, LocalId>> ends;  // vertex, feature
    for (std::size_t n = 0; n < features_.size(); ++n) {
      ends.emplace_back(static_cast<LocalId>(features_[n].key >> 32), static_cast<LocalId>(n));
      ends.emplace_back(static_cast<LocalId>(features_[n].key & 0xffffffffU), static_cast<LocalId>(n));
    }
    std::sort(ends.begin(), ends.end());
    for (std::size_t first = 0, last = 0; first < ends.size(); first = last) {
      const LocalId v = ends[first].first;
      while (last < ends.size() && ends[last].first == v) ++last;
      mesh_.vertex(v).dimension = 1;
      mesh_.vertex(v).entity = -1;
      const auto a = static_cast<std::size_t>(ends[first].second);
      const auto b = static_cast<std::size_t>(ends[last - 1].second);
      const bool passes = last - first == 2 && features_[a].group == features_[b].group &&
                          -dot(direction(v, features_[a].key), direction(v, features_[b].key)) >= straight_;
      if (!passes) {
        make_corner(v);
      } else {
        joined_.emplace_back(static_cast<LocalId>(a), static_cast<LocalId>(b));
      }
    }
  }

  Point<D> direction(LocalId v, std::uint64_t key) const {
    const auto low = static_cast<LocalId>(key >> 32);
    const LocalId other = low == v ? static_cast<LocalId>(key & 0xffffffffU) : low;
    return normalized(difference<D>(mesh_.point(other), mesh_.point(v)));
  }

  /// A vertex whose elements form more than one face-connected fan holds parts together that touch there alone.
  void find_pinched_vertices() {
    std::vector<LocalId> count(mesh_.vertices.size(), 0);
    for (const auto& element : mesh_.elements) {
      for (const LocalId v : element.node) ++count[static_cast<std::size_t>(v)];
    }
    std::vector<LocalId> seen(mesh_.elements.size(), -1);
    for (std::size_t v = 0; v < count.size(); ++v) {
      const auto vertex = static_cast<LocalId>(v);
      if (count[v] > 0 && mesh_.vertices[v].dimension < D && count_fan(vertex, seen) != count[v]) make_corner(vertex);
    }
  }

  /// Number of elements in the fan about a vertex that begins with the one it knows. seen: [element], last vertex.
  LocalId count_fan(LocalId v, std::vector<LocalId>& seen) const {
    std::vector<LocalId> fan = {mesh_.vertex(v).element};
    seen[static_cast<std::size_t>(fan[0])] = v;
    for (std::size_t n = 0; n < fan.size(); ++n) {
      const Element<D>& element = mesh_.element(fan[n]);
      for (std::size_t f = 0; f <= D; ++f) {
        const FaceRef ref = element.neighbour[f];
        if (element.node[f] == v || ref == no_face || seen[static_cast<std::size_t>(element_of(ref))] == v) continue;
        seen[static_cast<std::size_t>(element_of(ref))] = v;
        fan.push_back(element_of(ref));
      }
    }
    return static_cast<LocalId>(fan.size());
  }

  Point<D> face_normal(const SurfaceFace<D>& face) const {
    if constexpr (D == 2) {
      const Point<D> e = difference<D>(mesh_.point(face.node[1]), mesh_.point(face.node[0]));
      return {e[1], -e[0]};
    } else {
      return cross(difference<D>(mesh_.point(face.node[1]), mesh_.point(face.node[0])),
                   difference<D>(mesh_.point(face.node[2]), mesh_.point(face.node[0])));
    }
  }

  /// A patch is flat where no vertex leaves the plane of its largest face by more than round-off of its extent.
  void find_flat_patches() {
    std::vector<Real> largest(mesh_.patches.size(), 0);
    std::vector<LocalId> origin(mesh_.patches.size(), -1);
    for (const auto& face : faces_) {
      const auto patch = static_cast<std::size_t>(mesh_.element(element_of(face.ref)).patch[local_face(face.ref)]);
      const Point<D> normal = face_normal(face);
      const Real size = dot(normal, normal);
      if (size <= largest[patch]) continue;
      largest[patch] = size;
      origin[patch] = face.node[0];
      mesh_.patches[patch].normal = normalized(normal);
    }
    for (const auto& face : faces_) {
      if (kinds_[static_cast<std::size_t>(face.kind)].frozen) continue;  // its shape does not matter: nothing moves
      auto& patch =
          mesh_.patches[static_cast<std::size_t>(mesh_.element(element_of(face.ref)).patch[local_face(face.ref)])];
      const LocalId from = origin[static_cast<std::size_t>(&patch - mesh_.patches.data())];
      for (const LocalId v : face.node) {
        if (from < 0) break;
        const Point<D> away = difference<D>(mesh_.point(v), mesh_.point(from));
        if (std::abs(dot(away, patch.normal)) > 1e-10 * std::sqrt(dot(away, away))) patch.flat = false;
      }
    }
  }

  /// Chains of feature edges through curve vertices.
  void number_curves() {
    std::vector<LocalId> chain(features_.size());
    std::iota(chain.begin(), chain.end(), 0);
    parent_ = chain;
    for (const auto& [a, b] : joined_) {
      const LocalId ra = find(a);
      const LocalId rb = find(b);
      parent_[static_cast<std::size_t>(std::max(ra, rb))] = std::min(ra, rb);
    }
    std::vector<std::int32_t> number(features_.size(), -1);
    for (std::size_t n = 0; n < features_.size(); ++n) {
      auto& curve = number[static_cast<std::size_t>(find(static_cast<LocalId>(n)))];
      const auto low = static_cast<LocalId>(features_[n].key >> 32);
      const auto high = static_cast<LocalId>(features_[n].key & 0xffffffffU);
      const Point<D> tangent = direction(low, features_[n].key);
      if (curve < 0) {
        curve = static_cast<std::int32_t>(mesh_.curves.size());
        mesh_.curves.emplace_back();
        mesh_.curves.back().group = features_[n].group;
        mesh_.curves.back().locked = features_[n].locked;
        std::copy(tangent.begin(), tangent.end(), mesh_.curves.back().tangent.begin());
      }
      Curve& here = mesh_.curves[static_cast<std::size_t>(curve)];
      Real along = 0;
      for (std::size_t i = 0; i < D; ++i) along += tangent[i] * here.tangent[i];
      if (std::abs(along) < 1 - 1e-14) here.straight = false;
      mesh_.curve_edges.emplace(features_[n].key, curve);
      for (const LocalId v : {low, high}) {
        if (mesh_.vertex(v).dimension == 1) mesh_.vertex(v).entity = curve;
      }
    }
  }

  const RemeshMesh& input_;
  Real straight_;  ///< cosine of the feature angle
  WorkingMesh<D, Metric>& mesh_;
  std::vector<SurfaceFace<D>> faces_;
  std::vector<Kind> kinds_;
  std::vector<LocalId> parent_;
  std::vector<Feature> features_;
  std::vector<std::pair<LocalId, LocalId>> joined_;  ///< features that continue each other
};

}  // namespace

template <int D, class Metric>
void classify(const RemeshMesh& input, Real feature_angle, WorkingMesh<D, Metric>& mesh, BuildNotes& notes) {
  notes.unmatched_facets = Classifier<D, Metric>(input, feature_angle, mesh).run();
}

template void classify(const RemeshMesh&, Real, WorkingMesh<2, SizeMetric<2>>&, BuildNotes&);
template void classify(const RemeshMesh&, Real, WorkingMesh<2, TensorMetric<2>>&, BuildNotes&);
template void classify(const RemeshMesh&, Real, WorkingMesh<3, SizeMetric<3>>&, BuildNotes&);
template void classify(const RemeshMesh&, Real, WorkingMesh<3, TensorMetric<3>>&, BuildNotes&);

}  // namespace malleus::remeshing
