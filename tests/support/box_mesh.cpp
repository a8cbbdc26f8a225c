#include "support/box_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace malleus::test {
namespace {

using Cell = std::array<int, 3>;

class BoxBuilder {
 public:
  explicit BoxBuilder(const BoxMeshOptions& options) : box_(options) {
    if (box_.dim == 2) box_.cells[2] = 0;
    piece_.dim = box_.dim;
    piece_.region_names = {"box"};
    piece_.group_names = {"x_low", "x_high", "y_low", "y_high"};
    if (box_.dim == 3) piece_.group_names.insert(piece_.group_names.end(), {"z_low", "z_high"});
  }

  void add_cell(const Cell& cell) {
    if (box_.dim == 2) {
      add_simplex(cell, {0, 1}, 0);
      add_simplex(cell, {1, 0}, 1);
      return;
    }
    std::array<int, 3> axes = {0, 1, 2};
    GlobalId index = 0;
    do {
      add_simplex(cell, {axes[0], axes[1], axes[2]}, index++);
    } while (std::next_permutation(axes.begin(), axes.end()));
  }

  MeshPiece take() { return std::move(piece_); }

 private:
  /// The simplex of the path from the cell's low to its high corner that walks along the axes in the given order.
  void add_simplex(const Cell& cell, const std::vector<int>& axes, GlobalId index) {
    std::vector<Cell> corners = {cell};
    for (const int axis : axes) {
      corners.push_back(corners.back());
      ++corners.back()[static_cast<std::size_t>(axis)];
    }
    for (const Cell& corner : corners) piece_.element_nodes.push_back(node(corner));
    piece_.element_region.push_back(0);
    const GlobalId per_cell = box_.dim == 2 ? 2 : 6;
    const GlobalId cell_number =
        cell[0] + static_cast<GlobalId>(box_.cells[0]) * (cell[1] + static_cast<GlobalId>(box_.cells[1]) * cell[2]);
    piece_.element_ids.push_back(cell_number * per_cell + index);
    for (int axis = 0; axis < box_.dim; ++axis) {
      add_facet_if_on(corners, axis, 0, 2 * axis);
      add_facet_if_on(corners, axis, box_.cells[static_cast<std::size_t>(axis)], 2 * axis + 1);
    }
  }

  void add_facet_if_on(const std::vector<Cell>& corners, int axis, int plane, std::int32_t group) {
    std::vector<Cell> facet;
    for (const Cell& corner : corners) {
      if (corner[static_cast<std::size_t>(axis)] == plane) facet.push_back(corner);
    }
    if (static_cast<int>(facet.size()) != box_.dim) return;
    for (const Cell& corner : facet) piece_.facet_nodes.push_back(node(corner));
    piece_.facet_group.push_back(group);
  }

  LocalId node(const Cell& corner) {
    const GlobalId number =
        corner[0] + (box_.cells[0] + GlobalId{1}) * (corner[1] + (box_.cells[1] + GlobalId{1}) * corner[2]);
    const auto [found, is_new] = local_.try_emplace(number, static_cast<LocalId>(local_.size()));
    if (!is_new) return found->second;
    piece_.node_numbers.push_back(number);
    for (int axis = 0; axis < box_.dim; ++axis) {
      piece_.coordinates.push_back(coordinate(corner, axis, number));
    }
    return found->second;
  }

  Real coordinate(const Cell& corner, int axis, GlobalId number) const {
    const auto a = static_cast<std::size_t>(axis);
    const bool is_inside = corner[a] > 0 && corner[a] < box_.cells[a];
    const Real shift = is_inside ? box_.jitter * std::sin(12.9898 * static_cast<Real>(number) + 78.233 * axis) : 0.0;
    return box_.low[a] + (box_.high[a] - box_.low[a]) * (corner[a] + shift) / box_.cells[a];
  }

  BoxMeshOptions box_;
  MeshPiece piece_;
  std::map<GlobalId, LocalId> local_;
};

}  // namespace

MeshPiece box_piece(const Communicator& comm, const BoxMeshOptions& options) {
  BoxBuilder builder(options);
  Cell counts = options.cells;
  if (options.dim == 2) counts[2] = 1;
  const auto longest = static_cast<std::size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  const auto share = [&](int rank) {
    return static_cast<int>(static_cast<GlobalId>(counts[longest]) * rank / comm.size());
  };
  Cell begin = {0, 0, 0};
  Cell end = counts;
  begin[longest] = share(comm.rank());
  end[longest] = share(comm.rank() + 1);
  for (int k = begin[2]; k < end[2]; ++k) {
    for (int j = begin[1]; j < end[1]; ++j) {
      for (int i = begin[0]; i < end[0]; ++i) builder.add_cell({i, j, k});
    }
  }
  return builder.take();
}

Mesh box_mesh(const Communicator& comm, const BoxMeshOptions& options) {
  return std::move(assemble_mesh(comm, box_piece(comm, options)).mesh);
}

}  // namespace malleus::test
