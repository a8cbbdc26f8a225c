#include "mesh/facet_routing.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "mesh/faces.hpp"
#include "mesh/node_directory.hpp"
#include "mesh/number_table.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// A facet by its node numbers, increasing; the third is -1 first in 2D.
struct SentFacet {
  std::array<GlobalId, 3> nodes;
  std::int64_t group;

  GlobalId lowest() const { return nodes[0] < 0 ? nodes[1] : nodes[0]; }
};

/// The distinct facets whose lowest node has its rendezvous here.
struct FacetDirectory {
  std::vector<SentFacet> facets;  ///< by nodes
  std::vector<char> was_found;
  GlobalId repeated = 0;
};

FacetDirectory file_facets(const Communicator& comm, int dim, std::span<const GlobalId> facet_nodes,
                           std::span<const std::int32_t> facet_group) {
  std::map<int, std::vector<SentFacet>> sent;
  for (std::size_t f = 0; f < facet_group.size(); ++f) {
    SentFacet facet = {{-1, -1, -1}, facet_group[f]};
    std::copy_n(facet_nodes.begin() + static_cast<std::ptrdiff_t>(f) * dim, dim, facet.nodes.begin());
    std::sort(facet.nodes.begin(), facet.nodes.end());
    sent[rendezvous_rank(facet.lowest(), comm.size())].push_back(facet);
  }
  FacetDirectory directory;
  for (const auto& [rank, list] : sparse_exchange(comm, sent)) {
    directory.facets.insert(directory.facets.end(), list.begin(), list.end());
  }
  std::vector<SentFacet>& facets = directory.facets;
  std::stable_sort(facets.begin(), facets.end(),
                   [](const SentFacet& a, const SentFacet& b) { return a.nodes < b.nodes; });
  const auto last = std::unique(facets.begin(), facets.end(),
                                [](const SentFacet& a, const SentFacet& b) { return a.nodes == b.nodes; });
  directory.repeated = facets.end() - last;
  facets.erase(last, facets.end());
  directory.was_found.assign(facets.size(), 0);
  return directory;
}

/// Nodes of the piece that lie on unmatched faces or on any face: every node may start a facet. The ranks that hold
/// the lowest node of a filed facet: rank -> indices of facets it shall look for.
std::map<int, std::vector<std::size_t>> facets_to_look_for(const Communicator& comm, const MeshPiece& piece,
                                                           const FacetDirectory& directory) {
  std::map<int, std::vector<GlobalId>> held;
  for (const GlobalId number : piece.node_numbers) held[rendezvous_rank(number, comm.size())].push_back(number);
  NumberTable lowest;
  std::vector<std::vector<std::size_t>> facets_at;
  for (std::size_t f = 0; f < directory.facets.size(); ++f) {
    const LocalId known = lowest.size();
    const LocalId index = lowest.insert(directory.facets[f].lowest());
    if (index == known) facets_at.emplace_back();
    facets_at[static_cast<std::size_t>(index)].push_back(f);
  }
  std::map<int, std::vector<std::size_t>> result;
  for (const auto& [rank, numbers] : sparse_exchange(comm, held)) {
    for (const GlobalId number : numbers) {
      const LocalId index = lowest.find(number);
      if (index < 0) continue;
      const std::vector<std::size_t>& facets = facets_at[static_cast<std::size_t>(index)];
      result[rank].insert(result[rank].end(), facets.begin(), facets.end());
    }
  }
  return result;
}

using LocalFace = std::array<LocalId, 3>;

LocalFace sorted_local_face(LocalId a, LocalId b, LocalId c) {
  LocalFace face = {a, b, c};
  std::sort(face.begin(), face.end());
  return face;
}

/// Which of the wanted faces (sorted local nodes; -1 first in 2D) are faces of elements of the piece.
std::vector<char> find_faces(const MeshPiece& piece, std::span<const LocalFace> wanted) {
  std::vector<char> is_wanted_node(piece.node_numbers.size(), 0);
  std::vector<std::pair<LocalFace, std::size_t>> sorted;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i].back() < 0) continue;
    sorted.emplace_back(wanted[i], i);
    for (const LocalId node : wanted[i]) {
      if (node >= 0) is_wanted_node[static_cast<std::size_t>(node)] = 1;
    }
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<char> found(wanted.size(), 0);
  const int per_element = piece.dim + 1;
  for (LocalId e = 0; e < piece.elements(); ++e) {
    const LocalId* nodes = piece.element_nodes.data() + static_cast<std::size_t>(e) * per_element;
    for (int f = 0; f < per_element; ++f) {
      const auto corner = [&](int k) { return k < piece.dim ? nodes[face_node(piece.dim, f, k)] : -1; };
      const LocalFace face = sorted_local_face(corner(0), corner(1), corner(2));
      const bool possible = std::all_of(face.begin(), face.end(), [&](LocalId node) {
        return node < 0 || is_wanted_node[static_cast<std::size_t>(node)] != 0;
      });
      if (!possible) continue;
      const auto place = std::lower_bound(sorted.begin(), sorted.end(), std::pair(face, std::size_t{0}));
      if (place != sorted.end() && place->first == face) found[place->second] = 1;
    }
  }
  return found;
}

/// Local indices of a facet's nodes, sorted; all -1 where one is not held.
LocalFace local_face(const SentFacet& facet, const NumberTable& table) {
  LocalFace face = {-1, -1, -1};
  for (std::size_t k = 0; k < 3; ++k) {
    if (facet.nodes[k] < 0) continue;
    face[k] = table.find(facet.nodes[k]);
    if (face[k] < 0) return {-1, -1, -1};
  }
  std::sort(face.begin(), face.end());
  return face;
}

/// Keeps the offered facets that are faces here, and tells the directory ranks which were.
std::map<int, std::vector<char>> take_facets(const MeshPiece& piece,
                                             const std::map<int, std::vector<SentFacet>>& offered,
                                             RoutedFacets& routed) {
  NumberTable table(piece.node_numbers.size());
  for (const GlobalId number : piece.node_numbers) table.insert(number);
  std::vector<LocalFace> wanted;
  for (const auto& [rank, facets] : offered) {
    for (const SentFacet& facet : facets) wanted.push_back(local_face(facet, table));
  }
  const std::vector<char> found = find_faces(piece, wanted);
  std::map<int, std::vector<char>> answers;
  std::size_t next = 0;
  for (const auto& [rank, facets] : offered) {
    for (const SentFacet& facet : facets) {
      answers[rank].push_back(found[next]);
      if (found[next] != 0) {
        const LocalFace& face = wanted[next];
        routed.nodes.insert(routed.nodes.end(), face.end() - piece.dim, face.end());
        routed.group.push_back(static_cast<std::int32_t>(facet.group));
      }
      ++next;
    }
  }
  return answers;
}

}  // namespace

RoutedFacets route_facets(const Communicator& comm, const MeshPiece& piece, std::span<const GlobalId> facet_nodes,
                          std::span<const std::int32_t> facet_group) {
  RoutedFacets routed;
  FacetDirectory directory = file_facets(comm, piece.dim, facet_nodes, facet_group);
  routed.repeated = comm.sum(directory.repeated);
  const auto to_look_for = facets_to_look_for(comm, piece, directory);
  std::map<int, std::vector<SentFacet>> offers;
  for (const auto& [rank, facets] : to_look_for) {
    for (const std::size_t f : facets) offers[rank].push_back(directory.facets[f]);
  }
  const auto answers = take_facets(piece, sparse_exchange(comm, offers), routed);
  for (const auto& [rank, found] : sparse_exchange(comm, answers)) {
    const std::vector<std::size_t>& facets = to_look_for.at(rank);
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (found[i] != 0) directory.was_found[facets[i]] = 1;
    }
  }
  routed.loose.assign(piece.group_names.size(), 0);
  for (std::size_t f = 0; f < directory.facets.size(); ++f) {
    if (directory.was_found[f] == 0) ++routed.loose[static_cast<std::size_t>(directory.facets[f].group)];
  }
  if (!routed.loose.empty()) comm.sum_in_place(std::span(routed.loose));
  return routed;
}

}  // namespace malleus
