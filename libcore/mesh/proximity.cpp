#include "mesh/proximity.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "mesh/faces.hpp"
#include "mesh/node_directory.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

using Vector = Eigen::Vector3d;

/// A cell of a grid over space; level: its size is 2^level m.
struct Cell {
  std::array<std::int64_t, 3> index;
  std::int64_t level;
  auto operator<=>(const Cell&) const = default;
};

Cell cell_of(const Vector& point, Real size, std::int64_t level) {
  Cell cell = {{0, 0, 0}, level};
  for (int c = 0; c < 3; ++c) cell.index[static_cast<std::size_t>(c)] = std::llround(std::floor(point[c] / size));
  return cell;
}

int rank_of(const Cell& cell, int ranks) {
  std::uint64_t mixed = static_cast<std::uint64_t>(cell.level) + 17;
  for (const std::int64_t i : cell.index) {
    mixed = (mixed ^ static_cast<std::uint64_t>(i)) * 0x9E3779B97F4A7C15ULL;
    mixed ^= mixed >> 32;
  }
  return static_cast<int>(mixed % static_cast<std::uint64_t>(ranks));
}

Vector point_of(const MeshPiece& piece, LocalId node) {
  Vector point = Vector::Zero();
  for (int c = 0; c < piece.dim; ++c) point[c] = piece.coordinates[static_cast<std::size_t>(node) * piece.dim + c];
  return point;
}

/// Calls back with every cell that a box touches.
template <class Visit>
void for_each_cell(const Vector& low, const Vector& high, Real size, std::int64_t level, Visit visit) {
  const Cell first = cell_of(low, size, level);
  const Cell last = cell_of(high, size, level);
  for (std::int64_t i = first.index[0]; i <= last.index[0]; ++i) {
    for (std::int64_t j = first.index[1]; j <= last.index[1]; ++j) {
      for (std::int64_t k = first.index[2]; k <= last.index[2]; ++k) visit(Cell{{i, j, k}, level});
    }
  }
}

struct SentNode {
  Cell cell;
  std::int64_t region;
  GlobalId number;
  std::array<Real, 3> point;
  std::int64_t is_home;  ///< whether this is the cell in which the node lies

  Vector at() const { return {point[0], point[1], point[2]}; }
};

bool by_cell(const SentNode& a, const SentNode& b) {
  return std::tie(a.cell, a.region, a.number, b.is_home) < std::tie(b.cell, b.region, b.number, a.is_home);
}

/// (node, region) of every element's nodes, once each.
std::set<std::pair<LocalId, std::int32_t>> nodes_with_regions(const MeshPiece& piece) {
  std::set<std::pair<LocalId, std::int32_t>> result;
  for (std::size_t slot = 0; slot < piece.element_nodes.size(); ++slot) {
    const std::size_t element = slot / (static_cast<std::size_t>(piece.dim) + 1);
    result.emplace(piece.element_nodes[slot], piece.element_region[element]);
  }
  return result;
}

/// The numbers found on any rank, each once; the place of the lowest.
Findings gather_findings(const Communicator& comm, const std::map<GlobalId, Vector>& mine) {
  struct Found {
    GlobalId number;
    std::array<Real, 3> point;
  };
  std::map<int, std::vector<Found>> sent;
  for (const auto& [number, point] : mine) {
    sent[rendezvous_rank(number, comm.size())].push_back({number, {point[0], point[1], point[2]}});
  }
  std::map<GlobalId, std::array<Real, 3>> found;
  for (const auto& [rank, list] : sparse_exchange(comm, sent)) {
    for (const Found& entry : list) found.emplace(entry.number, entry.point);
  }
  Findings result;
  result.count = comm.sum(static_cast<GlobalId>(found.size()));
  const GlobalId none = std::numeric_limits<GlobalId>::max();
  const GlobalId lowest_here = found.empty() ? none : found.begin()->first;
  const GlobalId lowest = comm.min(lowest_here);
  if (lowest == none) return result;
  const GlobalId holder = comm.min(lowest_here == lowest ? static_cast<GlobalId>(comm.rank()) : none);
  if (comm.rank() == holder) result.place = found.begin()->second;
  comm.broadcast(std::span(result.place), static_cast<int>(holder));
  return result;
}

/// Nodes that some other node of the same cell and region, of lower number, coincides with.
std::map<GlobalId, Vector> coincident_in_cells(std::vector<SentNode>& nodes, Real tolerance) {
  std::sort(nodes.begin(), nodes.end(), by_cell);
  const auto is_same_entry = [](const SentNode& a, const SentNode& b) {
    return a.cell == b.cell && a.region == b.region && a.number == b.number;
  };
  nodes.erase(std::unique(nodes.begin(), nodes.end(), is_same_entry), nodes.end());
  std::map<GlobalId, Vector> found;
  for (std::size_t begin = 0; begin < nodes.size();) {
    std::size_t end = begin;
    while (end < nodes.size() && nodes[end].cell == nodes[begin].cell && nodes[end].region == nodes[begin].region)
      ++end;
    for (std::size_t i = begin; i < end; ++i) {
      if (nodes[i].is_home == 0) continue;
      for (std::size_t j = begin; j < end; ++j) {
        if (nodes[j].number >= nodes[i].number) continue;
        if ((nodes[i].at() - nodes[j].at()).norm() <= tolerance) found[nodes[i].number] = nodes[i].at();
      }
    }
    begin = end;
  }
  return found;
}

struct SentFacet {
  Cell cell;
  std::int64_t region;
  std::array<GlobalId, 3> numbers;  ///< -1 last in 2D
  std::array<std::array<Real, 3>, 3> points;

  Vector at(std::size_t k) const { return {points[k][0], points[k][1], points[k][2]}; }
};

/// Exterior faces of a piece with all that is needed to test a point against them.
std::vector<SentFacet> exterior_faces(const MeshPiece& piece, std::span<const char> is_exterior) {
  const auto n = static_cast<std::size_t>(piece.dim) + 1;
  std::vector<SentFacet> facets;
  for (std::size_t slot = 0; slot < is_exterior.size(); ++slot) {
    if (is_exterior[slot] == 0) continue;
    SentFacet facet = {{{0, 0, 0}, 0}, piece.element_region[slot / n], {-1, -1, -1}, {}};
    for (int k = 0; k < piece.dim; ++k) {
      const auto corner = static_cast<std::size_t>(face_node(piece.dim, static_cast<int>(slot % n), k));
      const LocalId node = piece.element_nodes[slot / n * n + corner];
      const Vector point = point_of(piece, node);
      facet.numbers[static_cast<std::size_t>(k)] = piece.node_numbers[static_cast<std::size_t>(node)];
      facet.points[static_cast<std::size_t>(k)] = {point[0], point[1], point[2]};
    }
    facets.push_back(facet);
  }
  return facets;
}

struct FacetBox {
  Vector low;
  Vector high;
  Real size;           ///< largest side
  std::int64_t level;  ///< of cells at least as large
};

FacetBox box_of(const SentFacet& facet, int dim, Real share) {
  FacetBox box = {facet.at(0), facet.at(0), 0, 0};
  for (std::size_t k = 1; k < static_cast<std::size_t>(dim); ++k) {
    box.low = box.low.cwiseMin(facet.at(k));
    box.high = box.high.cwiseMax(facet.at(k));
  }
  box.size = (box.high - box.low).maxCoeff();
  box.level = box.size > 0 ? std::ilogb(box.size) + 1 : 0;
  box.low.array() -= share * box.size;
  box.high.array() += share * box.size;
  return box;
}

/// Whether a point lies on the facet, away from its corners.
bool lies_on(const SentFacet& facet, const Vector& point, int dim, Real tolerance) {
  const Vector a = facet.at(1) - facet.at(0);
  const Vector to_point = point - facet.at(0);
  for (std::size_t k = 0; k < static_cast<std::size_t>(dim); ++k) {
    if ((point - facet.at(k)).norm() <= tolerance) return false;
  }
  if (dim == 2) {
    const Real along = to_point.dot(a) / a.squaredNorm();
    return along >= 0 && along <= 1 && (to_point - along * a).norm() <= tolerance;
  }
  const Vector b = facet.at(2) - facet.at(0);
  const Vector normal = a.cross(b);
  const Real area = normal.norm();
  if (!(area > 0) || std::abs(to_point.dot(normal)) > tolerance * area) return false;
  const Real slack = tolerance / std::max(a.norm(), b.norm());
  const Real s = to_point.cross(b).dot(normal) / (area * area);
  const Real t = a.cross(to_point).dot(normal) / (area * area);
  return s >= -slack && t >= -slack && s + t <= 1 + slack;
}

std::map<GlobalId, Vector> hanging_in_cells(int dim, Real share, std::vector<SentFacet>& facets,
                                            const std::map<int, std::vector<SentNode>>& nodes) {
  const auto key = [](const auto& entry) { return std::pair(entry.cell, entry.region); };
  std::sort(facets.begin(), facets.end(), [&](const SentFacet& a, const SentFacet& b) {
    return std::pair(key(a), a.numbers) < std::pair(key(b), b.numbers);
  });
  std::map<GlobalId, Vector> found;
  for (const auto& [rank, list] : nodes) {
    for (const SentNode& node : list) {
      auto facet = std::lower_bound(facets.begin(), facets.end(), key(node),
                                    [&](const SentFacet& f, const auto& wanted) { return key(f) < wanted; });
      for (; facet != facets.end() && key(*facet) == key(node); ++facet) {
        const bool is_corner =
            std::find(facet->numbers.begin(), facet->numbers.end(), node.number) != facet->numbers.end();
        if (is_corner) continue;
        if (lies_on(*facet, node.at(), dim, share * box_of(*facet, dim, share).size)) found[node.number] = node.at();
      }
    }
  }
  return found;
}

/// The levels of all ranks' facets.
std::vector<std::int64_t> levels_in_use(const Communicator& comm, const std::set<std::int64_t>& mine) {
  constexpr std::int64_t lowest = -200;
  std::vector<GlobalId> in_use(2 * -lowest, 0);
  for (const std::int64_t level : mine) {
    in_use[static_cast<std::size_t>(std::clamp<std::int64_t>(level - lowest, 0, -2 * lowest - 1))] = 1;
  }
  comm.sum_in_place(std::span(in_use));
  std::vector<std::int64_t> levels;
  for (std::size_t i = 0; i < in_use.size(); ++i) {
    if (in_use[i] > 0) levels.push_back(lowest + static_cast<std::int64_t>(i));
  }
  return levels;
}

}  // namespace

Findings find_coincident_nodes(const Communicator& comm, const MeshPiece& piece, Real tolerance) {
  const Real size = 8 * tolerance;
  std::map<int, std::vector<SentNode>> sent;
  for (const auto& [node, region] : nodes_with_regions(piece)) {
    const Vector point = point_of(piece, node);
    const Cell home = cell_of(point, size, 0);
    const Vector margin = Vector::Constant(tolerance);
    for_each_cell(point - margin, point + margin, size, 0, [&](const Cell& cell) {
      sent[rank_of(cell, comm.size())].push_back({cell,
                                                  region,
                                                  piece.node_numbers[static_cast<std::size_t>(node)],
                                                  {point[0], point[1], point[2]},
                                                  cell == home});
    });
  }
  std::vector<SentNode> nodes;
  for (const auto& [rank, list] : sparse_exchange(comm, sent)) nodes.insert(nodes.end(), list.begin(), list.end());
  return gather_findings(comm, coincident_in_cells(nodes, tolerance));
}

Findings find_hanging_nodes(const Communicator& comm, const MeshPiece& piece, std::span<const char> is_exterior,
                            Real share) {
  const std::vector<SentFacet> exterior = exterior_faces(piece, is_exterior);
  std::map<int, std::vector<SentFacet>> sent_facets;
  std::set<std::int64_t> levels_here;
  std::map<std::pair<GlobalId, std::int64_t>, Vector> corners;  // (number, region)
  for (SentFacet facet : exterior) {
    const FacetBox box = box_of(facet, piece.dim, share);
    levels_here.insert(box.level);
    for (std::size_t k = 0; k < static_cast<std::size_t>(piece.dim); ++k) {
      corners[{facet.numbers[k], facet.region}] = facet.at(k);
    }
    for_each_cell(box.low, box.high, std::ldexp(1.0, static_cast<int>(box.level)), box.level, [&](const Cell& cell) {
      facet.cell = cell;
      sent_facets[rank_of(cell, comm.size())].push_back(facet);
    });
  }
  std::map<int, std::vector<SentNode>> sent_nodes;
  for (const std::int64_t level : levels_in_use(comm, levels_here)) {
    for (const auto& [key, point] : corners) {
      const Cell cell = cell_of(point, std::ldexp(1.0, static_cast<int>(level)), level);
      sent_nodes[rank_of(cell, comm.size())].push_back(
          {cell, key.second, key.first, {point[0], point[1], point[2]}, 1});
    }
  }
  std::vector<SentFacet> facets;
  for (const auto& [rank, list] : sparse_exchange(comm, sent_facets))
    facets.insert(facets.end(), list.begin(), list.end());
  const auto nodes = sparse_exchange(comm, sent_nodes);
  return gather_findings(comm, hanging_in_cells(piece.dim, share, facets, nodes));
}

}  // namespace malleus
