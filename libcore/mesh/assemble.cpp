#include "mesh/assemble.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <tuple>

#include "base/error.hpp"
#include "mesh/faces.hpp"
#include "mesh/node_owners.hpp"
#include "mesh/simplex.hpp"
#include "mesh/space_filling_curve.hpp"
#include "parallel/agreement.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// Nodes that other ranks may hold, and who holds them.
struct Sharing {
  std::vector<LocalId> nodes;             ///< increasing
  std::vector<std::vector<int>> holders;  ///< of each: the ranks that hold it, this one among them, increasing
  std::vector<int> owners;                ///< of each
};

LocalId& at(std::vector<LocalId>& list, LocalId i) {
  return list[static_cast<std::size_t>(i)];
}
LocalId at(const std::vector<LocalId>& list, LocalId i) {
  return list[static_cast<std::size_t>(i)];
}

/// Elements of the piece in the order of the curve through their centroids; ties by their place in the piece.
std::vector<LocalId> curve_order(const Communicator& comm, const MeshPiece& piece) {
  const int dim = piece.dim;
  const Box box = bounding_box(comm, piece.coordinates, dim);
  std::vector<std::pair<std::uint64_t, LocalId>> keys(static_cast<std::size_t>(piece.elements()));
  for (LocalId e = 0; e < piece.elements(); ++e) {
    std::array<Real, 3> centroid = {0, 0, 0};
    for (int i = 0; i <= dim; ++i) {
      const LocalId node = at(piece.element_nodes, e * (dim + 1) + i);
      for (int c = 0; c < dim; ++c) {
        centroid[static_cast<std::size_t>(c)] +=
            piece.coordinates[static_cast<std::size_t>(node) * dim + c] / (dim + 1);
      }
    }
    keys[static_cast<std::size_t>(e)] = {hilbert_key(centroid.data(), dim, box), e};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<LocalId> order(keys.size());
  std::transform(keys.begin(), keys.end(), order.begin(), [](const auto& key) { return key.second; });
  return order;
}

/// Element nodes in the new order of elements, turned where the volume is negative. Still piece indices.
std::vector<LocalId> ordered_elements(const MeshPiece& piece, std::span<const LocalId> order) {
  const int n = piece.dim + 1;
  std::vector<LocalId> nodes;
  nodes.reserve(piece.element_nodes.size());
  with_dim(piece.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId e : order) {
      const LocalId* element = piece.element_nodes.data() + static_cast<std::size_t>(e) * n;
      nodes.insert(nodes.end(), element, element + n);
      SimplexPoints<D> points;
      for (int i = 0; i < n; ++i) {
        points.col(i) = Eigen::Map<const Point<D>>(piece.coordinates.data() + static_cast<std::size_t>(element[i]) * D);
      }
      if (simplex_volume<D>(points) < 0) std::swap(nodes[nodes.size() - 1], nodes[nodes.size() - 2]);
    }
  });
  return nodes;
}

int directory_rank(GlobalId number, int ranks) {
  auto mixed = static_cast<std::uint64_t>(number) * 0x9E3779B97F4A7C15ULL;
  mixed ^= mixed >> 32;
  return static_cast<int>(mixed % static_cast<std::uint64_t>(ranks));
}

/// Which of the candidate nodes (piece indices) are held elsewhere too: each rank reports to the directory rank of
/// the node's number, which answers with all who reported. [candidates] of sorted holders.
std::vector<std::vector<int>> find_holders(const Communicator& comm, const MeshPiece& piece,
                                           std::span<const LocalId> candidates) {
  std::map<int, std::vector<GlobalId>> reports;
  std::map<int, std::vector<std::size_t>> asked;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const GlobalId number = piece.node_numbers[static_cast<std::size_t>(candidates[i])];
    const int rank = directory_rank(number, comm.size());
    reports[rank].push_back(number);
    asked[rank].push_back(i);
  }
  const auto received = sparse_exchange(comm, reports);
  std::vector<std::pair<GlobalId, int>> holders;
  for (const auto& [rank, numbers] : received) {
    for (const GlobalId number : numbers) holders.emplace_back(number, rank);
  }
  std::sort(holders.begin(), holders.end());

  std::map<int, std::vector<std::int32_t>> answers;  // for each number asked: count, ranks
  for (const auto& [rank, numbers] : received) {
    std::vector<std::int32_t>& answer = answers[rank];
    for (const GlobalId number : numbers) {
      auto holder = std::lower_bound(holders.begin(), holders.end(), std::pair(number, -1));
      const std::size_t count_at = answer.size();
      answer.push_back(0);
      for (; holder != holders.end() && holder->first == number; ++holder) answer.push_back(holder->second);
      answer[count_at] = static_cast<std::int32_t>(answer.size() - count_at - 1);
    }
  }
  std::vector<std::vector<int>> result(candidates.size());
  for (const auto& [rank, answer] : sparse_exchange(comm, answers)) {
    std::size_t position = 0;
    for (const std::size_t i : asked[rank]) {
      const auto count = static_cast<std::size_t>(answer[position++]);
      result[i].assign(answer.begin() + static_cast<std::ptrdiff_t>(position),
                       answer.begin() + static_cast<std::ptrdiff_t>(position + count));
      position += count;
    }
  }
  return result;
}

/// A node whose elements are all here has only matched faces, or lies on the exterior: so only nodes of unmatched
/// faces can be held elsewhere.
Sharing find_sharing(const Communicator& comm, const MeshPiece& piece, std::span<const LocalId> element_nodes,
                     std::span<const LocalId> neighbours) {
  const int n = piece.dim + 1;
  std::vector<char> is_candidate(static_cast<std::size_t>(piece.nodes()), 0);
  for (std::size_t slot = 0; slot < neighbours.size(); ++slot) {
    if (neighbours[slot] >= 0) continue;
    const LocalId* element = element_nodes.data() + slot / n * n;
    for (int i = 0; i < n; ++i) {
      if (i != static_cast<int>(slot % n)) is_candidate[static_cast<std::size_t>(element[i])] = 1;
    }
  }
  std::vector<LocalId> candidates;
  for (LocalId node = 0; node < piece.nodes(); ++node) {
    if (is_candidate[static_cast<std::size_t>(node)] != 0) candidates.push_back(node);
  }
  std::vector<std::vector<int>> holders = find_holders(comm, piece, candidates);
  Sharing sharing;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (holders[i].size() < 2) continue;
    sharing.nodes.push_back(candidates[i]);
    sharing.holders.push_back(std::move(holders[i]));
  }
  return sharing;
}

/// Gives the shared nodes their owners, in stretches of the order in which the elements touch them.
void set_owners(const Communicator& comm, const MeshPiece& piece, std::span<const LocalId> element_nodes,
                Sharing& sharing) {
  constexpr LocalId alone = -1;
  std::vector<LocalId> place(static_cast<std::size_t>(piece.nodes()), alone);
  for (std::size_t i = 0; i < sharing.nodes.size(); ++i) at(place, sharing.nodes[i]) = static_cast<LocalId>(i);
  SharedNodes shared;
  std::vector<std::size_t> order;
  for (const LocalId node : element_nodes) {
    if (at(place, node) == alone) continue;
    const auto i = static_cast<std::size_t>(at(place, node));
    at(place, node) = alone;
    order.push_back(i);
    shared.numbers.push_back(piece.node_numbers[static_cast<std::size_t>(node)]);
    shared.holders.push_back(sharing.holders[i]);
  }
  const Real load = static_cast<Real>(piece.nodes()) - static_cast<Real>(sharing.nodes.size()) +
                    static_cast<Real>(piece.elements()) / node_work_in_elements;
  const std::vector<int> owners = choose_node_owners(comm, shared, load);
  sharing.owners.resize(sharing.nodes.size());
  for (std::size_t n = 0; n < order.size(); ++n) sharing.owners[order[n]] = owners[n];
}

/// The node numbers of the mesh under construction.
struct Numbering {
  std::vector<LocalId> node_of_piece;  ///< piece -> mesh, owned first
  std::vector<LocalId> piece_of_node;
  Ownership ownership;
  std::vector<GlobalId> copy_numbers;  ///< increasing
};

/// Owners tell the other holders the new numbers. Piece node -> new global number, of the copies held here.
std::vector<std::pair<GlobalId, LocalId>> numbers_of_copies(const Communicator& comm, const MeshPiece& piece,
                                                            const Sharing& sharing, const Numbering& numbering) {
  std::map<int, std::vector<GlobalId>> told;  // pairs: old number, new number
  std::vector<std::pair<GlobalId, LocalId>> old_to_piece;
  for (std::size_t i = 0; i < sharing.nodes.size(); ++i) {
    const LocalId node = sharing.nodes[i];
    const GlobalId old_number = piece.node_numbers[static_cast<std::size_t>(node)];
    if (sharing.owners[i] != comm.rank()) {
      old_to_piece.emplace_back(old_number, node);
      continue;
    }
    for (const int holder : sharing.holders[i]) {
      if (holder == comm.rank()) continue;
      told[holder].push_back(old_number);
      told[holder].push_back(numbering.ownership.begin() + at(numbering.node_of_piece, node));
    }
  }
  std::sort(old_to_piece.begin(), old_to_piece.end());
  std::vector<std::pair<GlobalId, LocalId>> copies;
  for (const auto& [rank, pairs] : sparse_exchange(comm, told)) {
    for (std::size_t i = 0; i < pairs.size(); i += 2) {
      const auto found = std::lower_bound(old_to_piece.begin(), old_to_piece.end(), std::pair(pairs[i], LocalId{-1}));
      check(found != old_to_piece.end() && found->first == pairs[i], "an owner tells holders only");
      copies.emplace_back(pairs[i + 1], found->second);
    }
  }
  check(copies.size() == old_to_piece.size(), "each copy was told its number");
  std::sort(copies.begin(), copies.end());
  return copies;
}

/// Owned nodes in the order in which the elements first touch them, then copies by global number.
Numbering number_nodes(const Communicator& comm, const MeshPiece& piece, std::span<const LocalId> element_nodes,
                       const Sharing& sharing) {
  constexpr LocalId unseen = -1;
  constexpr LocalId elsewhere = -2;
  Numbering numbering;
  numbering.node_of_piece.assign(static_cast<std::size_t>(piece.nodes()), unseen);
  for (std::size_t i = 0; i < sharing.nodes.size(); ++i) {
    if (sharing.owners[i] != comm.rank()) at(numbering.node_of_piece, sharing.nodes[i]) = elsewhere;
  }
  for (const LocalId node : element_nodes) {
    if (at(numbering.node_of_piece, node) != unseen) continue;
    at(numbering.node_of_piece, node) = static_cast<LocalId>(numbering.piece_of_node.size());
    numbering.piece_of_node.push_back(node);
  }
  numbering.ownership = Ownership(comm, static_cast<LocalId>(numbering.piece_of_node.size()));
  for (const auto& [number, node] : numbers_of_copies(comm, piece, sharing, numbering)) {
    at(numbering.node_of_piece, node) = static_cast<LocalId>(numbering.piece_of_node.size());
    numbering.piece_of_node.push_back(node);
    numbering.copy_numbers.push_back(number);
  }
  check(numbering.piece_of_node.size() == piece.node_numbers.size(), "every node of a piece belongs to an element");
  return numbering;
}

/// Sorted global nodes of a face; in 2D the last entry is no node.
using FaceKey = std::array<GlobalId, 3>;
constexpr GlobalId no_node = std::numeric_limits<GlobalId>::max();

FaceKey face_key(const Mesh& mesh, LocalId element, int face) {
  FaceKey key = {no_node, no_node, no_node};
  const auto nodes = mesh.nodes_of_element(element);
  for (int k = 0; k < mesh.dim; ++k) {
    key[static_cast<std::size_t>(k)] = mesh.global_node(nodes[static_cast<std::size_t>(face_node(mesh.dim, face, k))]);
  }
  std::sort(key.begin(), key.end());
  return key;
}

/// Ranks that hold every node of a face, this one apart, increasing.
std::vector<int> other_holders(const Communicator& comm, const Mesh& mesh, LocalId element, int face,
                               const std::map<LocalId, const std::vector<int>*>& holders_of) {
  std::vector<int> common;
  for (int k = 0; k < mesh.dim; ++k) {
    const LocalId node = mesh.nodes_of_element(element)[static_cast<std::size_t>(face_node(mesh.dim, face, k))];
    const auto found = holders_of.find(node);
    if (found == holders_of.end()) return {};
    if (k == 0) {
      common = *found->second;
      continue;
    }
    std::vector<int> kept;
    std::set_intersection(common.begin(), common.end(), found->second->begin(), found->second->end(),
                          std::back_inserter(kept));
    common = std::move(kept);
  }
  std::erase(common, comm.rank());
  return common;
}

/// A face as one rank shows it to another.
struct OfferedFace {
  FaceKey key;
  std::int64_t group;
};

/// An inner face whose other element is on another rank.
struct RemoteMatch {
  std::size_t slot;  ///< element * (dim+1) + face
  bool is_mine;      ///< whether this rank lists the facet, if it carries a group
};

/// Unmatched faces all of whose nodes are shared with one other rank may have their other element there: the faces
/// of the ranks are compared. groups: [slot] group or -1.
std::vector<RemoteMatch> faces_matched_elsewhere(const Communicator& comm, const Mesh& mesh, const Sharing& sharing,
                                                 const Numbering& numbering, std::span<const LocalId> neighbours,
                                                 std::span<const std::int32_t> groups) {
  const auto n = static_cast<std::size_t>(mesh.dim) + 1;
  std::map<LocalId, const std::vector<int>*> holders_of;
  for (std::size_t i = 0; i < sharing.nodes.size(); ++i) {
    holders_of[at(numbering.node_of_piece, sharing.nodes[i])] = &sharing.holders[i];
  }
  std::map<int, std::vector<OfferedFace>> offers;
  std::vector<std::pair<FaceKey, std::size_t>> offered;
  for (std::size_t slot = 0; slot < neighbours.size(); ++slot) {
    if (neighbours[slot] >= 0) continue;
    const auto element = static_cast<LocalId>(slot / n);
    const int face = static_cast<int>(slot % n);
    const std::vector<int> ranks = other_holders(comm, mesh, element, face, holders_of);
    if (ranks.empty()) continue;
    const FaceKey key = face_key(mesh, element, face);
    offered.emplace_back(key, slot);
    for (const int rank : ranks) offers[rank].push_back({key, groups[slot]});
  }
  std::sort(offered.begin(), offered.end());
  std::vector<RemoteMatch> matches;
  for (const auto& [rank, faces] : sparse_exchange(comm, offers)) {
    for (const OfferedFace& face : faces) {
      const auto found = std::lower_bound(offered.begin(), offered.end(), std::pair(face.key, std::size_t{0}));
      if (found == offered.end() || found->first != face.key) continue;
      matches.push_back({found->second, face.group < 0 || comm.rank() < rank});
    }
  }
  return matches;
}

void add_facet(Mesh& mesh, LocalId element, int face, std::int32_t group) {
  for (int k = 0; k < mesh.dim; ++k) {
    mesh.facet_nodes.push_back(mesh.nodes_of_element(element)[static_cast<std::size_t>(face_node(mesh.dim, face, k))]);
  }
  mesh.facet_element.push_back(element);
  mesh.facet_group.push_back(group);
}

/// Named facets by their sorted global nodes.
std::vector<std::pair<FaceKey, std::int32_t>> named_facets(const Mesh& mesh, const MeshPiece& piece,
                                                           const Numbering& numbering) {
  std::vector<std::pair<FaceKey, std::int32_t>> named;
  for (std::size_t f = 0; f < piece.facet_group.size(); ++f) {
    FaceKey key = {no_node, no_node, no_node};
    for (std::size_t k = 0; k < static_cast<std::size_t>(mesh.dim); ++k) {
      const LocalId node = piece.facet_nodes[f * static_cast<std::size_t>(mesh.dim) + k];
      key[k] = mesh.global_node(at(numbering.node_of_piece, node));
    }
    std::sort(key.begin(), key.end());
    named.emplace_back(key, piece.facet_group[f]);
  }
  std::sort(named.begin(), named.end());
  return named;
}

/// [slot] group of each face that is named, -1 of others.
std::vector<std::int32_t> groups_of_faces(const Mesh& mesh, const MeshPiece& piece, const Numbering& numbering) {
  const auto n = static_cast<std::size_t>(mesh.dim) + 1;
  std::vector<std::int32_t> groups(mesh.element_nodes.size(), -1);
  const auto named = named_facets(mesh, piece, numbering);
  if (named.empty()) return groups;
  std::vector<char> has_name(static_cast<std::size_t>(mesh.nodes()), 0);
  for (const LocalId node : piece.facet_nodes)
    has_name[static_cast<std::size_t>(at(numbering.node_of_piece, node))] = 1;
  const auto may_be_named = [&](std::size_t slot) {
    const auto nodes = mesh.nodes_of_element(static_cast<LocalId>(slot / n));
    for (std::size_t i = 0; i < n; ++i) {
      if (i != slot % n && has_name[static_cast<std::size_t>(nodes[i])] == 0) return false;
    }
    return true;
  };
  for (std::size_t slot = 0; slot < groups.size(); ++slot) {
    if (!may_be_named(slot)) continue;
    const FaceKey key = face_key(mesh, static_cast<LocalId>(slot / n), static_cast<int>(slot % n));
    const auto found = std::lower_bound(named.begin(), named.end(), std::pair(key, std::int32_t{-1}));
    if (found != named.end() && found->first == key) groups[slot] = found->second;
  }
  return groups;
}

/// Exterior facets, then inner ones with a group; of the two sides of an inner facet one lists it.
void collect_facets(const Communicator& comm, Mesh& mesh, const MeshPiece& piece, const Numbering& numbering,
                    const Sharing& sharing, std::span<const LocalId> neighbours) {
  const auto n = static_cast<std::size_t>(mesh.dim) + 1;
  const std::vector<std::int32_t> groups = groups_of_faces(mesh, piece, numbering);
  enum class Kind : char { exterior, inner, listed_elsewhere };
  std::vector<Kind> kinds(neighbours.size(), Kind::exterior);
  for (std::size_t slot = 0; slot < neighbours.size(); ++slot) {
    if (neighbours[slot] < 0) continue;
    const bool first = static_cast<std::size_t>(neighbours[slot]) > slot / n;
    kinds[slot] = first ? Kind::inner : Kind::listed_elsewhere;
  }
  for (const RemoteMatch& match : faces_matched_elsewhere(comm, mesh, sharing, numbering, neighbours, groups)) {
    kinds[match.slot] = match.is_mine ? Kind::inner : Kind::listed_elsewhere;
  }
  for (std::size_t slot = 0; slot < kinds.size(); ++slot) {
    if (kinds[slot] != Kind::exterior) continue;
    add_facet(mesh, static_cast<LocalId>(slot / n), static_cast<int>(slot % n), groups[slot]);
  }
  mesh.exterior_facets = mesh.facets();
  for (std::size_t slot = 0; slot < kinds.size(); ++slot) {
    if (kinds[slot] != Kind::inner || groups[slot] < 0) continue;
    add_facet(mesh, static_cast<LocalId>(slot / n), static_cast<int>(slot % n), groups[slot]);
  }
}

}  // namespace

AssembledMesh assemble_mesh(const Communicator& comm, const MeshPiece& piece) {
  const std::vector<LocalId> order = curve_order(comm, piece);
  std::vector<LocalId> element_nodes = ordered_elements(piece, order);
  std::vector<LocalId> neighbours;
  agree(comm, [&] { neighbours = element_neighbours(piece.dim, piece.nodes(), element_nodes); });
  Sharing sharing = find_sharing(comm, piece, element_nodes, neighbours);
  set_owners(comm, piece, element_nodes, sharing);
  Numbering numbering = number_nodes(comm, piece, element_nodes, sharing);

  AssembledMesh assembled;
  Mesh& mesh = assembled.mesh;
  mesh.dim = piece.dim;
  mesh.region_names = piece.region_names;
  mesh.group_names = piece.group_names;
  mesh.node_ownership = numbering.ownership;
  mesh.copy_numbers = numbering.copy_numbers;
  mesh.node_halo = Halo(comm, mesh.node_ownership, mesh.copy_numbers);
  for (const LocalId node : numbering.piece_of_node) {
    const Real* point = piece.coordinates.data() + static_cast<std::size_t>(node) * piece.dim;
    mesh.coordinates.insert(mesh.coordinates.end(), point, point + piece.dim);
  }
  for (LocalId& node : element_nodes) node = at(numbering.node_of_piece, node);
  mesh.element_nodes = std::move(element_nodes);
  assembled.element_of_piece.resize(order.size());
  for (std::size_t e = 0; e < order.size(); ++e) {
    const auto from = static_cast<std::size_t>(order[e]);
    assembled.element_of_piece[from] = static_cast<LocalId>(e);
    mesh.element_region.push_back(piece.element_region[from]);
    if (!piece.element_ids.empty()) mesh.element_ids.push_back(piece.element_ids[from]);
  }
  mesh.total_elements = comm.sum(static_cast<GlobalId>(mesh.elements()));
  collect_facets(comm, mesh, piece, numbering, sharing, neighbours);
  assembled.node_of_piece = std::move(numbering.node_of_piece);
  return assembled;
}

}  // namespace malleus
