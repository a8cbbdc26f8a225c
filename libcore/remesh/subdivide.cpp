#include "remesh/subdivide.hpp"

#include <algorithm>
#include <array>

#include "base/error.hpp"
#include "base/index.hpp"
#include "field/fielded_piece.hpp"

namespace malleus {
namespace {

class Subdivision {
 public:
  Subdivision(const Mesh& mesh, FieldStore& fields) : mesh_(mesh), element_columns_(fields, Support::element) {
    find_edges();
    MeshPiece& piece = result_.piece;
    piece.dim = mesh.dim;
    piece.region_names = mesh.region_names;
    piece.group_names = mesh.group_names;
    add_nodes(FieldColumns(fields, Support::node));
    for (LocalId e = 0; e < mesh.elements(); ++e) add_element(e);
    for (LocalId f = 0; f < mesh.facets(); ++f) {
      if (mesh.facet_group[index(f)] >= 0) add_facet(f);
    }
  }

  const FieldedPiece& piece() const { return result_; }

 private:
  static std::uint64_t key(LocalId a, LocalId b) {
    return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | static_cast<std::uint64_t>(std::max(a, b));
  }

  void find_edges() {
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      for (const LocalId a : mesh_.nodes_of_element(e)) {
        for (const LocalId b : mesh_.nodes_of_element(e)) {
          if (a < b) edges_.push_back(key(a, b));
        }
      }
    }
    std::sort(edges_.begin(), edges_.end());
    edges_.erase(std::unique(edges_.begin(), edges_.end()), edges_.end());
  }

  LocalId middle(LocalId a, LocalId b) const {
    const auto found = std::lower_bound(edges_.begin(), edges_.end(), key(a, b));
    return mesh_.nodes() + static_cast<LocalId>(found - edges_.begin());
  }

  void add_nodes(const FieldColumns& columns) {
    MeshPiece& piece = result_.piece;
    const std::size_t width = columns.width();
    for (LocalId node = 0; node < mesh_.nodes(); ++node) {
      piece.node_numbers.push_back(mesh_.global_node(node));
      columns.append(node, result_.node_values);
    }
    piece.coordinates = mesh_.coordinates;
    for (const std::uint64_t edge : edges_) {
      const auto a = static_cast<LocalId>(edge >> 32);
      const auto b = static_cast<LocalId>(edge & 0xffffffffU);
      piece.node_numbers.push_back(number_of_middle(mesh_.global_node(a), mesh_.global_node(b)));
      for (int c = 0; c < mesh_.dim; ++c) piece.coordinates.push_back(0.5 * (mesh_.point(a)[c] + mesh_.point(b)[c]));
      for (std::size_t i = 0; i < width; ++i) {
        result_.node_values.push_back(
            0.5 * (result_.node_values[index(a) * width + i] + result_.node_values[index(b) * width + i]));
      }
    }
  }

  /// Alike on all ranks that hold the edge, unlike for any two edges.
  GlobalId number_of_middle(GlobalId a, GlobalId b) const {
    const GlobalId n = mesh_.total_nodes();
    return n + std::min(a, b) * n + std::max(a, b);
  }

  void add(LocalId parent, std::span<const LocalId> nodes) {
    result_.piece.element_nodes.insert(result_.piece.element_nodes.end(), nodes.begin(), nodes.end());
    result_.piece.element_region.push_back(mesh_.element_region[index(parent)]);
    element_columns_.append(parent, result_.element_values);
  }

  void add_element(LocalId e) {
    const auto v = mesh_.nodes_of_element(e);
    if (mesh_.dim == 2) {
      const std::array<LocalId, 3> m = {middle(v[1], v[2]), middle(v[0], v[2]), middle(v[0], v[1])};
      for (std::size_t i = 0; i < 3; ++i) add(e, std::array{v[i], m[(i + 2) % 3], m[(i + 1) % 3]});
      add(e, m);
      return;
    }
    for (std::size_t i = 0; i < 4; ++i) {
      std::array<LocalId, 4> corner;
      for (std::size_t k = 0; k < 4; ++k) corner[k] = k == i ? v[i] : middle(v[i], v[k]);
      add(e, corner);
    }
    add_octahedron(e, v);
  }

  void add_octahedron(LocalId e, std::span<const LocalId> v) {
    const std::array<LocalId, 6> m = {middle(v[0], v[1]), middle(v[0], v[2]), middle(v[0], v[3]),
                                      middle(v[1], v[2]), middle(v[1], v[3]), middle(v[2], v[3])};
    // A diagonal joins the middles of opposite edges; the other four go round it.
    struct Diagonal {
      std::array<std::size_t, 2> ends;
      std::array<std::size_t, 4> ring;
    };
    constexpr std::array<Diagonal, 3> diagonals = {
        {{{0, 5}, {1, 2, 4, 3}}, {{1, 4}, {0, 2, 5, 3}}, {{2, 3}, {0, 1, 5, 4}}}};
    const auto square = [&](const Diagonal& d) {
      Real sum = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto& x = result_.piece.coordinates;
        const Real difference = x[index(m[d.ends[0]]) * 3 + c] - x[index(m[d.ends[1]]) * 3 + c];
        sum += difference * difference;
      }
      return sum;
    };
    const auto& best = *std::min_element(diagonals.begin(), diagonals.end(),
                                         [&](const Diagonal& a, const Diagonal& b) { return square(a) < square(b); });
    for (std::size_t k = 0; k < 4; ++k)
      add(e, std::array{m[best.ends[0]], m[best.ends[1]], m[best.ring[k]], m[best.ring[(k + 1) % 4]]});
  }

  void add_facet(LocalId f) {
    const auto v = mesh_.nodes_of_facet(f);
    const auto add_part = [&](std::span<const LocalId> nodes) {
      result_.piece.facet_nodes.insert(result_.piece.facet_nodes.end(), nodes.begin(), nodes.end());
      result_.piece.facet_group.push_back(mesh_.facet_group[index(f)]);
    };
    if (mesh_.dim == 2) {
      add_part(std::array{v[0], middle(v[0], v[1])});
      add_part(std::array{middle(v[0], v[1]), v[1]});
      return;
    }
    const std::array<LocalId, 3> m = {middle(v[1], v[2]), middle(v[0], v[2]), middle(v[0], v[1])};
    for (std::size_t i = 0; i < 3; ++i) add_part(std::array{v[i], m[(i + 2) % 3], m[(i + 1) % 3]});
    add_part(m);
  }

  const Mesh& mesh_;
  FieldColumns element_columns_;
  std::vector<std::uint64_t> edges_;  ///< both ends' local numbers, increasing
  FieldedPiece result_;
};

}  // namespace

void subdivide(const Communicator& comm, Mesh& mesh, FieldStore& fields) {
  constexpr GlobalId most_nodes = 3'000'000'000;  // numbers of middles are made of two nodes' numbers
  if (mesh.total_nodes() > most_nodes) throw InputError("refine: the mesh is too large to be halved again");
  const Subdivision subdivision(mesh, fields);
  mesh = assemble_with_fields(comm, subdivision.piece(), fields);
}

}  // namespace malleus
