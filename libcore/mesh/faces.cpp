#include "mesh/faces.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>

#include "base/error.hpp"

namespace malleus {
namespace {

/// A face filed under its smallest node, by its other nodes in increasing order.
struct FiledFace {
  LocalId second = -1;
  LocalId third = -1;
  LocalId element = -1;
  std::int32_t face = 0;
};

std::array<LocalId, 3> sorted_face(int dim, const LocalId* nodes, int face) {
  constexpr LocalId last = std::numeric_limits<LocalId>::max();
  std::array<LocalId, 3> sorted = {nodes[face_node(dim, face, 0)], nodes[face_node(dim, face, 1)], last};
  if (dim == 3) sorted[2] = nodes[face_node(dim, face, 2)];
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

bool same_face(const FiledFace& a, const FiledFace& b) {
  return a.second == b.second && a.third == b.third;
}

/// Pairs equal faces of one file (all faces with the same smallest node).
void match_file(std::span<FiledFace> file, int per_element, std::vector<LocalId>& neighbours) {
  std::sort(file.begin(), file.end(), [](const FiledFace& a, const FiledFace& b) {
    return std::tie(a.second, a.third, a.element) < std::tie(b.second, b.third, b.element);
  });
  for (std::size_t i = 0; i + 1 < file.size(); ++i) {
    if (!same_face(file[i], file[i + 1])) continue;
    if (i + 2 < file.size() && same_face(file[i], file[i + 2])) {
      throw InputError("the mesh is not manifold: a face belongs to more than two elements");
    }
    const FiledFace& a = file[i];
    const FiledFace& b = file[i + 1];
    neighbours[static_cast<std::size_t>(a.element) * per_element + a.face] = b.element;
    neighbours[static_cast<std::size_t>(b.element) * per_element + b.face] = a.element;
    ++i;
  }
}

}  // namespace

std::vector<LocalId> element_neighbours(int dim, LocalId nodes, std::span<const LocalId> element_nodes) {
  const int per_element = dim + 1;
  const auto elements = static_cast<LocalId>(element_nodes.size() / static_cast<std::size_t>(per_element));
  std::vector<std::int64_t> file_begin(static_cast<std::size_t>(nodes) + 1, 0);
  const auto for_each_face = [&](auto visit) {
    for (LocalId e = 0; e < elements; ++e) {
      const LocalId* vertices = element_nodes.data() + static_cast<std::size_t>(e) * per_element;
      for (int f = 0; f < per_element; ++f) visit(e, f, sorted_face(dim, vertices, f));
    }
  };
  for_each_face([&](LocalId, int, const auto& face) { ++file_begin[static_cast<std::size_t>(face[0]) + 1]; });
  std::partial_sum(file_begin.begin(), file_begin.end(), file_begin.begin());

  std::vector<FiledFace> filed(static_cast<std::size_t>(file_begin.back()));
  std::vector<std::int64_t> next(file_begin.begin(), file_begin.end() - 1);
  for_each_face([&](LocalId e, int f, const auto& face) {
    filed[static_cast<std::size_t>(next[static_cast<std::size_t>(face[0])]++)] = {face[1], face[2], e, f};
  });

  std::vector<LocalId> neighbours(element_nodes.size(), -1);
  for (LocalId n = 0; n < nodes; ++n) {
    const auto begin = static_cast<std::size_t>(file_begin[static_cast<std::size_t>(n)]);
    const auto end = static_cast<std::size_t>(file_begin[static_cast<std::size_t>(n) + 1]);
    match_file(std::span(filed).subspan(begin, end - begin), per_element, neighbours);
  }
  return neighbours;
}

}  // namespace malleus
