#include "mesh/faces.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"

namespace malleus {
namespace {

/// A face filed under its smallest node, by its other nodes in increasing order.
struct FiledFace {
  std::uint64_t others = 0;
  LocalId element = -1;
  std::int32_t face = 0;
};

struct SortedFace {
  LocalId smallest;
  std::uint64_t others;  ///< the second in the upper half; in 2D nothing in the lower
};

SortedFace sorted_face(int dim, const LocalId* nodes, int face) {
  const LocalId a = nodes[face_node(dim, face, 0)];
  const LocalId b = nodes[face_node(dim, face, 1)];
  const LocalId low = std::min(a, b);
  const LocalId high = std::max(a, b);
  if (dim == 2) return {low, static_cast<std::uint64_t>(high) << 32};
  const LocalId c = nodes[face_node(dim, face, 2)];
  const LocalId second = std::max(low, std::min(high, c));
  const LocalId third = std::max(high, c);
  return {std::min(low, c), static_cast<std::uint64_t>(second) << 32 | static_cast<std::uint64_t>(third)};
}

/// Pairs equal faces of one file (all faces with the same smallest node).
void match_file(std::span<FiledFace> file, int per_element, std::vector<LocalId>& neighbours) {
  std::sort(file.begin(), file.end(), [](const FiledFace& a, const FiledFace& b) {
    return a.others != b.others ? a.others < b.others : a.element < b.element;
  });
  for (std::size_t i = 0; i + 1 < file.size(); ++i) {
    if (file[i].others != file[i + 1].others) continue;
    if (i + 2 < file.size() && file[i].others == file[i + 2].others) {
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
  for_each_face(
      [&](LocalId, int, const SortedFace& face) { ++file_begin[static_cast<std::size_t>(face.smallest) + 1]; });
  std::partial_sum(file_begin.begin(), file_begin.end(), file_begin.begin());

  std::vector<FiledFace> filed(static_cast<std::size_t>(file_begin.back()));
  std::vector<std::int64_t> next(file_begin.begin(), file_begin.end() - 1);
  for_each_face([&](LocalId e, int f, const SortedFace& face) {
    filed[static_cast<std::size_t>(next[static_cast<std::size_t>(face.smallest)]++)] = {face.others, e, f};
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
