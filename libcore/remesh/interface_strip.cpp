#include "remesh/interface_strip.hpp"

#include <algorithm>

#include "base/index.hpp"

namespace malleus {
namespace {

/// A number that orders the ranks differently in each round, no two alike; its low bits are the rank. Exact in a Real.
Real drawn_number(int rank, int round) {
  constexpr int rank_bits = 24;
  const auto seed = static_cast<std::uint64_t>(rank + 1) * 0x9E3779B97F4A7C15ULL +
                    static_cast<std::uint64_t>(round + 1) * 0xBF58476D1CE4E5B9ULL;
  const std::uint64_t mixed = (seed ^ (seed >> 31)) * 0x94D049BB133111EBULL;
  return static_cast<Real>(((mixed >> (64 - rank_bits)) << rank_bits) + static_cast<std::uint64_t>(rank) + 1);
}

int rank_of(Real drawn) {
  constexpr std::uint64_t mask = (std::uint64_t{1} << 24) - 1;
  return static_cast<int>(static_cast<std::uint64_t>(drawn) & mask) - 1;
}

/// The largest of the holders' values at each node.
void level_largest(const Mesh& mesh, std::vector<Real>& values) {
  mesh.node_halo.max_to_owners(std::span(values), 1);
  mesh.node_halo.update_copies(std::span(values), 1);
}

Real largest_at(const Mesh& mesh, LocalId element, const std::vector<Real>& values) {
  Real largest = 0;
  for (const LocalId node : mesh.nodes_of_element(element)) largest = std::max(largest, values[index(node)]);
  return largest;
}

}  // namespace

std::vector<int> layers_from(const Communicator& /*the halo knows it*/, const Mesh& mesh,
                             const std::vector<std::uint8_t>& marks, int layers) {
  // Nearness, layers + 1 at the marks and 0 beyond, grows by the maximum.
  std::vector<Real> nearness(index(mesh.nodes()), 0);
  for (std::size_t node = 0; node < marks.size(); ++node) nearness[node] = marks[node] != 0 ? layers + 1 : 0;
  level_largest(mesh, nearness);
  for (int layer = layers; layer > 0; --layer) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (largest_at(mesh, e, nearness) != layer + 1) continue;
      for (const LocalId node : mesh.nodes_of_element(e))
        nearness[index(node)] = std::max<Real>(nearness[index(node)], layer);
    }
    level_largest(mesh, nearness);
  }
  std::vector<int> distance(nearness.size());
  std::transform(nearness.begin(), nearness.end(), distance.begin(),
                 [&](Real near) { return layers + 1 - static_cast<int>(near); });
  return distance;
}

std::vector<int> move_interfaces(const Communicator& comm, const Mesh& mesh, const std::vector<std::uint8_t>& marks,
                                 int layers, int round) {
  std::vector<Real> winner(index(mesh.nodes()), 0);
  for (std::size_t node = 0; node < marks.size(); ++node)
    winner[node] = marks[node] != 0 ? drawn_number(comm.rank(), round) : 0;
  level_largest(mesh, winner);
  std::vector<Real> taken(index(mesh.elements()), 0);
  for (int layer = 0; layer < layers; ++layer) {
    std::vector<LocalId> reached;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (taken[index(e)] != 0) continue;
      taken[index(e)] = largest_at(mesh, e, winner);
      if (taken[index(e)] != 0) reached.push_back(e);
    }
    std::vector<Real> next(winner.size(), 0);
    for (const LocalId e : reached) {
      for (const LocalId node : mesh.nodes_of_element(e))
        next[index(node)] = std::max(next[index(node)], taken[index(e)]);
    }
    level_largest(mesh, next);
    for (std::size_t node = 0; node < winner.size(); ++node) {
      if (winner[node] == 0) winner[node] = next[node];
    }
  }
  std::vector<int> destinations(taken.size());
  std::transform(taken.begin(), taken.end(), destinations.begin(),
                 [&](Real drawn) { return drawn == 0 ? comm.rank() : rank_of(drawn); });
  return destinations;
}

}  // namespace malleus
