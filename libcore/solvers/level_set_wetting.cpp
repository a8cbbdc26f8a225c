#include "solvers/level_set_wetting.hpp"

#include <algorithm>
#include <cmath>

namespace malleus {
namespace {

constexpr Real nothing = 1e300;
/// Slope towards the wall: with none, whole elements would hold one value, and their volume would come and go at once.
constexpr Real lag = 0.01;

Real distance(const Mesh& mesh, LocalId a, LocalId b) {
  Real square = 0;
  for (int c = 0; c < mesh.dim; ++c)
    square += (mesh.point(a)[c] - mesh.point(b)[c]) * (mesh.point(a)[c] - mesh.point(b)[c]);
  return std::sqrt(square);
}

}  // namespace

WallWetting::WallWetting(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph,
                         std::span<const char> is_wall)
    : mesh_(mesh) {
  std::vector<char> waits(is_wall.begin(), is_wall.end());
  for (int pass = 0; choose_givers(comm, graph, waits); ++pass) {
    if (pass > 0) continue;
    GlobalId left = 0;
    for (LocalId n = 0; n < mesh.owned_nodes(); ++n) left += waits[static_cast<std::size_t>(n)];
    without_interior_ = comm.sum(left);
  }
}

/// Adds a pass: of the waiting nodes, those with a neighbour that does not wait take from the nearest such (the lowest
/// number of equals). Returns whether there was one.
bool WallWetting::choose_givers(const Communicator& comm, const NodeGraph& graph, std::vector<char>& waits) {
  const auto n = static_cast<std::size_t>(mesh_.nodes());
  std::vector<Real> nearest(n, nothing);
  for (std::size_t node = 0; node < n; ++node) {
    if (waits[node] == 0) continue;
    for (const LocalId giver : graph.of(static_cast<LocalId>(node))) {
      if (waits[static_cast<std::size_t>(giver)] != 0) continue;
      nearest[node] = std::min(nearest[node], distance(mesh_, static_cast<LocalId>(node), giver));
    }
  }
  mesh_.node_halo.min_to_owners(nearest, 1);
  mesh_.node_halo.update_copies(nearest, 1);

  std::vector<Real> number(n, nothing);  // of the giver; exact as Real below 2^53
  for (std::size_t node = 0; node < n; ++node) {
    if (waits[node] == 0 || nearest[node] == nothing) continue;
    for (const LocalId giver : graph.of(static_cast<LocalId>(node))) {
      if (waits[static_cast<std::size_t>(giver)] != 0) continue;
      if (distance(mesh_, static_cast<LocalId>(node), giver) > nearest[node]) continue;
      number[node] = std::min(number[node], static_cast<Real>(mesh_.global_node(giver)));
    }
  }
  mesh_.node_halo.min_to_owners(number, 1);
  mesh_.node_halo.update_copies(number, 1);

  std::vector<Transfer> transfers;
  std::vector<LocalId> taking;
  for (std::size_t node = 0; node < n; ++node) {
    if (waits[node] == 0 || number[node] == nothing) continue;
    taking.push_back(static_cast<LocalId>(node));
    for (const LocalId giver : graph.of(static_cast<LocalId>(node))) {
      if (static_cast<Real>(mesh_.global_node(giver)) == number[node]) {
        transfers.push_back({giver, static_cast<LocalId>(node)});
      }
    }
  }
  for (const LocalId node : taking) waits[static_cast<std::size_t>(node)] = 0;
  if (!comm.any(!taking.empty())) return false;
  passes_.push_back(std::move(transfers));
  taking_.push_back(std::move(taking));
  return true;
}

void WallWetting::apply(std::span<Real> level_set) const {
  std::vector<Real> given(level_set.size());
  for (std::size_t pass = 0; pass < passes_.size(); ++pass) {
    std::fill(given.begin(), given.end(), -nothing);
    for (const Transfer& transfer : passes_[pass]) {
      given[static_cast<std::size_t>(transfer.to)] =
          level_set[static_cast<std::size_t>(transfer.from)] - lag * distance(mesh_, transfer.from, transfer.to);
    }
    mesh_.node_halo.max_to_owners(given, 1);
    mesh_.node_halo.update_copies(given, 1);
    for (const LocalId node : taking_[pass]) {
      level_set[static_cast<std::size_t>(node)] = given[static_cast<std::size_t>(node)];
    }
  }
}

}  // namespace malleus
