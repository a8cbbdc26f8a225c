#include "partition/scotch_start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"

#ifdef MALLEUS_HAS_PTSCOTCH
#include <mpi.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
extern "C" {
#include <ptscotch.h>
}

#include "base/floating_point.hpp"

namespace malleus {
namespace {

constexpr double imbalance = 0.03;
/// Sums of weights must fit 32 bits; the rest is for vertices that weigh nothing and count as 1.
constexpr Real largest_sum = 1e9;

/// The whole numbers of Scotch for weights of which all together make `sum`.
std::vector<SCOTCH_Num> whole_weights(std::span<const Real> weights, Real total, Real sum) {
  std::vector<SCOTCH_Num> whole(weights.size());
  std::transform(weights.begin(), weights.end(), whole.begin(),
                 [&](Real w) { return static_cast<SCOTCH_Num>(std::max(1.0, std::round(w / total * sum))); });
  return whole;
}

void check_done(const Communicator& comm, int code, const char* step) {
  if (comm.any(code != 0)) throw NumericsError(fmt::format("PT-Scotch failed to {} ([partition] method)", step));
}

void refuse_what_is_too_large(const WorkGraph& graph, const Communicator& comm, std::size_t parts) {
  constexpr GlobalId most = std::numeric_limits<SCOTCH_Num>::max() / 2;
  const GlobalId edges = comm.sum(static_cast<GlobalId>(graph.neighbours.size()));
  if (graph.ownership.total() <= most && edges <= most && static_cast<GlobalId>(parts) <= graph.ownership.total())
    return;
  throw InputError(
      fmt::format("partition: {} elements with {} common faces in {} parts are not for PT-Scotch, whose "
                  "numbers have 32 bits and whose parts are not empty; take another start",
                  graph.ownership.total(), edges / 2, parts));
}

/// Handles of the library that are let go at the end.
struct Handles {
  explicit Handles(const Communicator& comm) {
    SCOTCH_dgraphInit(&graph, comm.raw());
    SCOTCH_stratInit(&strategy);
    SCOTCH_archInit(&machine);
  }
  Handles(const Handles&) = delete;
  Handles& operator=(const Handles&) = delete;
  ~Handles() {
    SCOTCH_archExit(&machine);
    SCOTCH_stratExit(&strategy);
    SCOTCH_dgraphExit(&graph);
  }
  SCOTCH_Dgraph graph{};
  SCOTCH_Strat strategy{};
  SCOTCH_Arch machine{};
};

}  // namespace

bool has_scotch() {
  return true;
}

std::vector<int> scotch_parts(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares) {
  refuse_what_is_too_large(graph, comm, shares.size());
  Real mine = 0;
  for (const Real w : graph.weights) mine += w;
  std::vector<SCOTCH_Num> weights = whole_weights(graph.weights, comm.sum(mine), largest_sum);
  std::vector<SCOTCH_Num> start(graph.start.begin(), graph.start.end());
  std::vector<SCOTCH_Num> neighbours;
  for (const LocalId v : graph.neighbours) neighbours.push_back(static_cast<SCOTCH_Num>(graph.number(v)));
  std::vector<SCOTCH_Num> edge_weights(graph.edge_weights.begin(), graph.edge_weights.end());
  Real total_share = 0;
  for (const Real share : shares) total_share += share;
  std::vector<SCOTCH_Num> loads = whole_weights(shares, total_share, 1000.0 * static_cast<Real>(shares.size()));

  setenv("SCOTCH_PTHREAD_NUMBER", "1", 1);  // with more threads two runs differ
  const TrapsOff traps_off;
  SCOTCH_randomReset();
  Handles scotch(comm);
  const auto vertices = static_cast<SCOTCH_Num>(graph.owned());
  const auto edges = static_cast<SCOTCH_Num>(neighbours.size());
  check_done(comm,
             SCOTCH_dgraphBuild(&scotch.graph, 0, vertices, vertices, start.data(), nullptr, weights.data(), nullptr,
                                edges, edges, neighbours.data(), nullptr, edge_weights.data()),
             "take the graph");
  SCOTCH_stratDgraphMapBuild(&scotch.strategy, SCOTCH_STRATDEFAULT, comm.size(), static_cast<SCOTCH_Num>(shares.size()),
                             imbalance);
  SCOTCH_archCmpltw(&scotch.machine, static_cast<SCOTCH_Num>(shares.size()), loads.data());
  std::vector<SCOTCH_Num> parts(static_cast<std::size_t>(vertices) + 1, 0);
  check_done(comm, SCOTCH_dgraphMap(&scotch.graph, &scotch.machine, &scotch.strategy, parts.data()), "divide the mesh");
  parts.pop_back();
  return {parts.begin(), parts.end()};
}

}  // namespace malleus

#else

namespace malleus {

bool has_scotch() {
  return false;
}

std::vector<int> scotch_parts(const Communicator&, const WorkGraph&, std::span<const Real>) {
  throw InputError(
      "partition: this program was built without PT-Scotch; install libptscotch-dev and build again, or take another "
      "start");
}

}  // namespace malleus

#endif
