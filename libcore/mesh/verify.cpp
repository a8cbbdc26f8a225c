#include "mesh/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>

#include "base/error.hpp"
#include "mesh/face_census.hpp"
#include "mesh/faces.hpp"
#include "mesh/simplex.hpp"

namespace malleus {
namespace {

bool all_in_range(std::span<const std::int32_t> list, std::int32_t low, std::int32_t high) {
  return std::all_of(list.begin(), list.end(), [&](std::int32_t i) { return i >= low && i < high; });
}

bool sizes_fit(const Mesh& mesh) {
  const auto n = static_cast<std::size_t>(mesh.dim);
  const std::size_t facets = mesh.facet_group.size();
  return (mesh.dim == 2 || mesh.dim == 3) && mesh.coordinates.size() % n == 0 &&
         mesh.element_nodes.size() == mesh.element_region.size() * (n + 1) &&
         (mesh.element_ids.empty() || mesh.element_ids.size() == mesh.element_region.size()) &&
         mesh.facet_nodes.size() == facets * n && mesh.facet_element.size() == facets && mesh.exterior_facets >= 0 &&
         mesh.exterior_facets <= mesh.facets() && mesh.nodes() == mesh.node_halo.owned() + mesh.node_halo.copies() &&
         mesh.copy_numbers.size() == static_cast<std::size_t>(mesh.node_halo.copies());
}

bool ranges_fit(const Mesh& mesh) {
  const auto regions = static_cast<std::int32_t>(mesh.region_names.size());
  const auto groups = static_cast<std::int32_t>(mesh.group_names.size());
  return all_in_range(mesh.element_nodes, 0, mesh.nodes()) && all_in_range(mesh.element_region, 0, regions) &&
         all_in_range(mesh.facet_nodes, 0, mesh.nodes()) && all_in_range(mesh.facet_element, 0, mesh.elements()) &&
         all_in_range(mesh.facet_group, -1, groups);
}

bool every_node_is_used(const Mesh& mesh) {
  std::vector<char> used(static_cast<std::size_t>(mesh.nodes()), 0);
  for (const LocalId node : mesh.element_nodes) used[static_cast<std::size_t>(node)] = 1;
  return std::find(used.begin(), used.end(), 0) == used.end();
}

bool copies_are_of_others(const Mesh& mesh) {
  const auto& copies = mesh.copy_numbers;
  return std::is_sorted(copies.begin(), copies.end()) &&
         std::adjacent_find(copies.begin(), copies.end()) == copies.end() &&
         std::none_of(copies.begin(), copies.end(), [&](GlobalId n) { return mesh.node_ownership.owns(n); });
}

/// Collective: what an owner sends must be what the copies say.
bool copies_agree(const Mesh& mesh) {
  std::vector<Real> points = mesh.coordinates;
  mesh.node_halo.update_copies(std::span(points), mesh.dim);
  std::vector<GlobalId> numbers(static_cast<std::size_t>(mesh.nodes()), -1);
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    numbers[static_cast<std::size_t>(node)] = mesh.global_node(node);
  }
  mesh.node_halo.update_copies(std::span(numbers), 1);
  const bool same_numbers = std::equal(mesh.copy_numbers.begin(), mesh.copy_numbers.end(),
                                       numbers.begin() + static_cast<std::ptrdiff_t>(mesh.owned_nodes()));
  return same_numbers && points == mesh.coordinates;
}

bool volumes_are_positive(const Mesh& mesh) {
  return with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (!(simplex_volume<D>(simplex_points<D>(mesh, e)) > 0)) return false;
    }
    return true;
  });
}

/// Face of its element that a facet is, with equal orientation; -1 where it is none.
int face_of_facet(const Mesh& mesh, LocalId facet) {
  const auto wanted = mesh.nodes_of_facet(facet);
  const auto element = mesh.nodes_of_element(mesh.facet_element[static_cast<std::size_t>(facet)]);
  for (int face = 0; face <= mesh.dim; ++face) {
    std::array<LocalId, 3> nodes = {-1, -1, -1};
    for (int k = 0; k < mesh.dim; ++k) {
      nodes[static_cast<std::size_t>(k)] = element[static_cast<std::size_t>(face_node(mesh.dim, face, k))];
    }
    // Even permutations keep the orientation: all rotations of a triangle, the edge as it is.
    for (int turn = 0; turn < (mesh.dim == 3 ? 3 : 1); ++turn) {
      if (std::equal(wanted.begin(), wanted.end(), nodes.begin())) return face;
      std::rotate(nodes.begin(), nodes.begin() + 1, nodes.begin() + mesh.dim);
    }
  }
  return -1;
}

/// What is wrong with the faces; every entry is decided on this rank alone.
struct FaceFaults {
  bool not_manifold = false;
  bool not_a_face = false;
  bool exterior_wrong = false;
  bool inner_wrong = false;
};

FaceFaults find_face_faults(const Mesh& mesh, const std::vector<FaceCount>& elements_of_face) {
  const auto n = static_cast<std::size_t>(mesh.dim) + 1;
  FaceFaults faults;
  faults.not_manifold = std::any_of(elements_of_face.begin(), elements_of_face.end(),
                                    [](const FaceCount& count) { return count.all > 2; });
  std::vector<char> listed(elements_of_face.size(), 0);
  for (LocalId facet = 0; facet < mesh.facets(); ++facet) {
    const int face = face_of_facet(mesh, facet);
    if (face < 0) {
      faults.not_a_face = true;
      continue;
    }
    const auto element = static_cast<std::size_t>(mesh.facet_element[static_cast<std::size_t>(facet)]);
    const std::size_t slot = element * n + static_cast<std::size_t>(face);
    const bool is_exterior = facet < mesh.exterior_facets;
    if (is_exterior && (elements_of_face[slot].all != 1 || listed[slot] != 0)) faults.exterior_wrong = true;
    if (!is_exterior && (elements_of_face[slot].all != 2 || mesh.facet_group[static_cast<std::size_t>(facet)] < 0)) {
      faults.inner_wrong = true;
    }
    listed[slot] = 1;
  }
  for (std::size_t slot = 0; slot < listed.size(); ++slot) {
    if (elements_of_face[slot].all == 1 && listed[slot] == 0) faults.exterior_wrong = true;
  }
  return faults;
}

std::vector<GlobalId> global_nodes(const Mesh& mesh, std::span<const LocalId> nodes) {
  std::vector<GlobalId> numbers;
  numbers.reserve(nodes.size());
  for (const LocalId node : nodes) numbers.push_back(mesh.global_node(node));
  return numbers;
}

bool facets_are_distinct(const Communicator& comm, const Mesh& mesh) {
  const std::vector<GlobalId> numbers = global_nodes(mesh, mesh.facet_nodes);
  const auto n = static_cast<std::size_t>(mesh.dim);
  std::vector<FaceNumbers> facets;
  for (std::size_t f = 0; f < mesh.facet_group.size(); ++f) {
    facets.push_back(face_numbers(std::span(numbers).subspan(f * n, n)));
  }
  const std::vector<FaceCount> counts = count_equal_faces(comm, facets);
  return std::all_of(counts.begin(), counts.end(), [](const FaceCount& count) { return count.all == 1; });
}

bool names_are_alike(const Communicator& comm, const Mesh& mesh) {
  std::string mine = fmt::format("{}\n{}\n", mesh.dim, mesh.group_names.size());
  for (const std::string& name : mesh.region_names) mine += name + "\n";
  for (const std::string& name : mesh.group_names) mine += name + "\n";
  std::string of_root = mine;
  comm.broadcast(of_root);
  return comm.all(of_root == mine);
}

}  // namespace

std::vector<std::string> broken_promises(const Communicator& comm, const Mesh& mesh) {
  std::vector<std::string> broken;
  const auto promise = [&](bool holds, const char* sentence) {
    const GlobalId guilty = comm.sum(GlobalId{holds ? 0 : 1});
    if (guilty > 0) broken.push_back(fmt::format("{} ({} of {} ranks)", sentence, guilty, comm.size()));
    return guilty == 0;
  };
  if (!promise(names_are_alike(comm, mesh), "dimension and names are alike on all ranks")) return broken;
  if (!promise(sizes_fit(mesh), "the lists of the mesh fit together")) return broken;
  if (!promise(ranges_fit(mesh), "indices are within their lists")) return broken;
  promise(every_node_is_used(mesh), "every node belongs to an element of its rank");
  promise(copies_are_of_others(mesh), "copies are sorted, distinct and owned elsewhere");
  promise(copies_agree(mesh), "copies have their owner's number and coordinates");
  promise(comm.sum(GlobalId{mesh.elements()}) == mesh.total_elements, "the total of elements is their sum");
  promise(comm.sum(GlobalId{mesh.owned_nodes()}) == mesh.total_nodes(), "the total of nodes is the sum of the owned");
  promise(volumes_are_positive(mesh), "every element has a positive volume");
  const std::vector<FaceNumbers> faces = faces_of_elements(mesh.dim, global_nodes(mesh, mesh.element_nodes));
  const FaceFaults faults = find_face_faults(mesh, count_equal_faces(comm, faces));
  promise(!faults.not_manifold, "a face belongs to at most two elements");
  promise(!faults.not_a_face, "a facet is a face of its element and points out of it");
  promise(!faults.exterior_wrong, "the exterior facets are the faces of one element, each once");
  promise(!faults.inner_wrong, "further facets are inner faces with a group");
  promise(facets_are_distinct(comm, mesh), "a facet is listed once over all ranks");
  return broken;
}

void verify_mesh(const Communicator& comm, const Mesh& mesh) {
  const std::vector<std::string> broken = broken_promises(comm, mesh);
  if (broken.empty()) return;
  throw Defect(fmt::format("broken promises of the mesh: {}", fmt::join(broken, "; ")),
               std::source_location::current());
}

}  // namespace malleus
