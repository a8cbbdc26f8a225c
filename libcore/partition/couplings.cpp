#include "partition/couplings.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "base/index.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// The values of any nodes, asked of their owners: in the order of `nodes`. values: [owned node]. Collective.
std::vector<GlobalId> ask_owners(const Communicator& comm, const Mesh& mesh, std::span<const GlobalId> values,
                                 const std::vector<GlobalId>& nodes) {
  std::map<int, std::vector<GlobalId>> questions;
  for (const GlobalId node : nodes) questions[mesh.node_ownership.owner_of(node)].push_back(node);
  std::map<int, std::vector<GlobalId>> answers;
  for (const auto& [rank, asked] : sparse_exchange(comm, questions)) {
    for (const GlobalId node : asked)
      answers[rank].push_back(values[static_cast<std::size_t>(node - mesh.node_ownership.begin())]);
  }
  const std::map<int, std::vector<GlobalId>> heard = sparse_exchange(comm, answers);
  std::map<int, std::size_t> next;
  std::vector<GlobalId> found;
  for (const GlobalId node : nodes) {
    const int rank = mesh.node_ownership.owner_of(node);
    found.push_back(heard.at(rank)[next[rank]++]);
  }
  return found;
}

std::vector<GlobalId> ends(const std::vector<NodeCoupling>& couplings) {
  std::vector<GlobalId> nodes;
  for (const NodeCoupling& coupling : couplings) nodes.insert(nodes.end(), {coupling.first, coupling.second});
  return nodes;
}

/// The first of the elements around each owned node: [owned node]. Collective.
std::vector<GlobalId> first_elements(const Mesh& mesh, const Ownership& elements) {
  std::vector<Real> first(index(mesh.nodes()), std::numeric_limits<Real>::max());  // numbers are exact in it
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e))
      first[index(node)] = std::min(first[index(node)], static_cast<Real>(elements.begin() + e));
  }
  mesh.node_halo.min_to_owners(std::span(first), 1);
  std::vector<GlobalId> numbers;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node)
    numbers.push_back(static_cast<GlobalId>(first[index(node)]));
  return numbers;
}

/// One side of an edge between two elements, on its way to the rank of the first.
struct Side {
  GlobalId element;
  GlobalId other;
  Real weight;
};

}  // namespace

std::vector<ElementCoupling> couple_elements(const Communicator& comm, const Mesh& mesh, const Ownership& elements,
                                             const std::vector<NodeCoupling>& couplings) {
  if (comm.sum(static_cast<GlobalId>(couplings.size())) == 0) return {};
  const std::vector<GlobalId> found = ask_owners(comm, mesh, first_elements(mesh, elements), ends(couplings));
  std::map<int, std::vector<Side>> outgoing;
  for (std::size_t i = 0; i < couplings.size(); ++i) {
    const GlobalId a = found[2 * i];
    const GlobalId b = found[2 * i + 1];
    if (a == b) continue;
    outgoing[elements.owner_of(a)].push_back({a, b, couplings[i].weight});
    outgoing[elements.owner_of(b)].push_back({b, a, couplings[i].weight});
  }
  std::vector<Side> sides;
  for (const auto& [rank, list] : sparse_exchange(comm, outgoing)) sides.insert(sides.end(), list.begin(), list.end());
  std::stable_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.element, a.other, a.weight) < std::tie(b.element, b.other, b.weight);
  });
  std::vector<ElementCoupling> joined;
  for (std::size_t i = 0; i < sides.size();) {
    Real weight = 0;
    const Side& side = sides[i];
    for (; i < sides.size() && sides[i].element == side.element && sides[i].other == side.other; ++i)
      weight += sides[i].weight;
    joined.push_back({static_cast<LocalId>(side.element - elements.begin()), side.other,
                      static_cast<std::int32_t>(std::max(1.0, std::round(weight)))});
  }
  return joined;
}

std::vector<CutCoupling> cut_couplings(const Communicator& comm, const Mesh& mesh,
                                       const std::vector<NodeCoupling>& couplings, std::span<const int> part_of_node) {
  if (comm.sum(static_cast<GlobalId>(couplings.size())) == 0) return {};
  const std::vector<GlobalId> parts(part_of_node.begin(), part_of_node.begin() + mesh.owned_nodes());
  const std::vector<GlobalId> found = ask_owners(comm, mesh, parts, ends(couplings));
  std::vector<CutCoupling> cut;
  for (std::size_t i = 0; i < couplings.size(); ++i) {
    if (found[2 * i] == found[2 * i + 1]) continue;
    cut.push_back({static_cast<int>(found[2 * i]), static_cast<int>(found[2 * i + 1]), couplings[i].weight});
  }
  return cut;
}

}  // namespace malleus
