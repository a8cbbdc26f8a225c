#include "partition/work_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "mesh/faces.hpp"
#include "mesh/number_table.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// Whole weights add up to about 2^weight_bits: exact in a double, and fine enough for any mesh.
constexpr int weight_bits = 46;

/// A face of an element of this rank whose other side may lie elsewhere.
struct OpenFace {
  std::array<GlobalId, 3> nodes;  ///< increasing; in 2D the last is -1
  GlobalId element;
  std::int64_t slot;  ///< element * (dim + 1) + face, on the rank of the element

  bool operator<(const OpenFace& other) const {
    return nodes != other.nodes ? nodes < other.nodes : element < other.element;
  }
};

struct FaceAnswer {
  std::int64_t slot;
  GlobalId neighbour;
};

std::vector<char> find_shared_nodes(const Mesh& mesh) {
  std::vector<char> is_shared(static_cast<std::size_t>(mesh.nodes()), 0);
  for (const Halo::Partner& partner : mesh.node_halo.partners()) {
    for (const LocalId node : partner.sends) is_shared[static_cast<std::size_t>(node)] = 1;
  }
  std::fill(is_shared.begin() + mesh.owned_nodes(), is_shared.end(), 1);
  return is_shared;
}

/// Faces without a neighbour here and with shared nodes only, by the rank that owns their lowest node.
std::map<int, std::vector<OpenFace>> open_faces(const Mesh& mesh, std::span<const LocalId> neighbours,
                                                GlobalId first_element) {
  const std::vector<char> is_shared = find_shared_nodes(mesh);
  const auto sides = static_cast<std::size_t>(mesh.dim) + 1;
  std::map<int, std::vector<OpenFace>> faces;
  for (std::size_t slot = 0; slot < neighbours.size(); ++slot) {
    if (neighbours[slot] >= 0) continue;
    OpenFace face = {
        {-1, -1, -1}, first_element + static_cast<GlobalId>(slot / sides), static_cast<std::int64_t>(slot)};
    bool may_match = true;
    for (int k = 0; k < mesh.dim; ++k) {
      const int corner = face_node(mesh.dim, static_cast<int>(slot % sides), k);
      const LocalId node = mesh.element_nodes[slot / sides * sides + static_cast<std::size_t>(corner)];
      may_match = may_match && is_shared[static_cast<std::size_t>(node)] != 0;
      face.nodes[static_cast<std::size_t>(k)] = mesh.global_node(node);
    }
    if (!may_match) continue;
    std::sort(face.nodes.begin(), face.nodes.begin() + mesh.dim);
    faces[mesh.node_ownership.owner_of(face.nodes[0])].push_back(face);
  }
  return faces;
}

void match_open_faces(const Communicator& comm, const std::map<int, std::vector<OpenFace>>& outgoing,
                      const Ownership& elements, std::vector<GlobalId>& across) {
  std::vector<OpenFace> faces;
  for (const auto& [rank, list] : sparse_exchange(comm, outgoing)) faces.insert(faces.end(), list.begin(), list.end());
  std::sort(faces.begin(), faces.end());
  std::map<int, std::vector<FaceAnswer>> answers;
  for (std::size_t i = 0; i + 1 < faces.size(); ++i) {
    if (faces[i].nodes != faces[i + 1].nodes) continue;
    answers[elements.owner_of(faces[i].element)].push_back({faces[i].slot, faces[i + 1].element});
    answers[elements.owner_of(faces[i + 1].element)].push_back({faces[i + 1].slot, faces[i].element});
  }
  for (const auto& [rank, list] : sparse_exchange(comm, answers)) {
    for (const FaceAnswer& answer : list) across[static_cast<std::size_t>(answer.slot)] = answer.neighbour;
  }
}

/// Work in whole units, at least one where there is any. Sets graph.unit.
void set_weights(const Communicator& comm, std::span<const Real> work, WorkGraph& graph) {
  Real mine = 0;
  for (const Real w : work) mine += w;
  const Real total = comm.sum(mine);
  check(total > 0 && std::isfinite(total), "the work is positive");
  graph.unit = std::ldexp(1.0, static_cast<int>(std::ceil(std::log2(total))) - weight_bits);
  graph.weights.resize(work.size());
  for (std::size_t e = 0; e < work.size(); ++e) {
    graph.weights[e] = work[e] > 0 ? std::max(1.0, std::round(work[e] / graph.unit)) : 0;
  }
}

void list_edges(std::span<const GlobalId> across, std::span<const ElementCoupling> coupled, WorkGraph& graph) {
  const auto sides = static_cast<std::size_t>(graph.dim) + 1;
  const auto owned = static_cast<LocalId>(across.size() / sides);
  const auto add = [&](GlobalId element, signed char face, std::int32_t weight) {
    const auto copy = std::lower_bound(graph.copy_numbers.begin(), graph.copy_numbers.end(), element);
    graph.faces.push_back(face);
    graph.edge_weights.push_back(weight);
    graph.neighbours.push_back(graph.ownership.owns(element)
                                   ? static_cast<LocalId>(element - graph.ownership.begin())
                                   : owned + static_cast<LocalId>(copy - graph.copy_numbers.begin()));
  };
  graph.start.assign(1, 0);
  auto coupling = coupled.begin();
  for (LocalId e = 0; e < owned; ++e) {
    for (std::size_t face = 0; face < sides; ++face) {
      const GlobalId element = across[static_cast<std::size_t>(e) * sides + face];
      if (element >= 0) add(element, static_cast<signed char>(face), 1);
    }
    for (; coupling != coupled.end() && coupling->element == e; ++coupling) add(coupling->other, -1, coupling->weight);
    graph.start.push_back(static_cast<std::int64_t>(graph.neighbours.size()));
  }
}

void set_centres(const Mesh& mesh, WorkGraph& graph) {
  graph.centres.assign(static_cast<std::size_t>(mesh.elements()) * static_cast<std::size_t>(mesh.dim), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    Real* centre = graph.centres.data() + static_cast<std::size_t>(e) * static_cast<std::size_t>(mesh.dim);
    for (const LocalId node : mesh.nodes_of_element(e)) {
      for (int c = 0; c < mesh.dim; ++c) centre[c] += mesh.point(node)[c] / (mesh.dim + 1);
    }
  }
}

}  // namespace

std::vector<Real> element_work(const Communicator& comm, const Mesh& mesh, const WorkModel& model) {
  std::vector<Real> valence(static_cast<std::size_t>(mesh.nodes()), 0);
  for (const LocalId node : mesh.element_nodes) valence[static_cast<std::size_t>(node)] += 1;
  mesh.node_halo.add_to_owners(valence, 1);
  mesh.node_halo.update_copies(std::span<Real>(valence), 1);
  std::vector<Real> work(static_cast<std::size_t>(mesh.elements()), model.element);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e)) {
      work[static_cast<std::size_t>(e)] += model.node / valence[static_cast<std::size_t>(node)];
    }
  }
  Real plain = 0;
  Real weighted = 0;
  for (std::size_t e = 0; e < work.size(); ++e) {
    plain += work[e];
    if (!model.factor.empty()) work[e] *= model.factor[e];
    weighted += work[e];
  }
  plain = comm.sum(plain);
  weighted = comm.sum(weighted);
  if (!(weighted > 0)) throw InputError("partition: no element weighs anything; some weight must be > 0");
  if (!model.factor.empty()) {
    for (Real& w : work) w *= plain / weighted;
  }
  return work;
}

std::vector<GlobalId> face_neighbours(const Communicator& comm, const Mesh& mesh, const Ownership& elements) {
  const std::vector<LocalId> local = element_neighbours(mesh.dim, mesh.nodes(), mesh.element_nodes);
  std::vector<GlobalId> across(local.size());
  std::transform(local.begin(), local.end(), across.begin(),
                 [&](LocalId e) { return e < 0 ? GlobalId{-1} : elements.begin() + e; });
  if (comm.size() > 1) match_open_faces(comm, open_faces(mesh, local, elements.begin()), elements, across);
  return across;
}

WorkGraph build_work_graph(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                           const std::vector<NodeCoupling>& couplings) {
  check(work.size() == static_cast<std::size_t>(mesh.elements()), "one work an element");
  WorkGraph graph;
  graph.dim = mesh.dim;
  graph.ownership = Ownership(comm, mesh.elements());
  const std::vector<GlobalId> across = face_neighbours(comm, mesh, graph.ownership);
  const std::vector<ElementCoupling> coupled = couple_elements(comm, mesh, graph.ownership, couplings);
  for (const GlobalId element : across) {
    if (element >= 0 && !graph.ownership.owns(element)) graph.copy_numbers.push_back(element);
  }
  for (const ElementCoupling& coupling : coupled) {
    if (!graph.ownership.owns(coupling.other)) graph.copy_numbers.push_back(coupling.other);
  }
  std::sort(graph.copy_numbers.begin(), graph.copy_numbers.end());
  graph.copy_numbers.erase(std::unique(graph.copy_numbers.begin(), graph.copy_numbers.end()), graph.copy_numbers.end());
  graph.halo = Halo(comm, graph.ownership, graph.copy_numbers);

  list_edges(across, coupled, graph);
  set_weights(comm, work, graph);
  set_centres(mesh, graph);
  return graph;
}

}  // namespace malleus
