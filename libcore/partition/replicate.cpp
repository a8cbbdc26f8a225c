#include "partition/replicate.hpp"

#include "base/error.hpp"
#include "parallel/gather.hpp"

namespace malleus {

WorkGraph replicate_graph(const Communicator& comm, const Communicator& alone, const WorkGraph& graph) {
  check(alone.size() == 1, "a replicated graph belongs to one rank");
  std::vector<std::int64_t> degrees;
  std::vector<LocalId> neighbours;
  for (LocalId v = 0; v < graph.owned(); ++v)
    degrees.push_back(static_cast<std::int64_t>(graph.last(v) - graph.first(v)));
  for (const LocalId v : graph.neighbours) neighbours.push_back(static_cast<LocalId>(graph.number(v)));

  WorkGraph whole;
  whole.dim = graph.dim;
  whole.unit = graph.unit;
  whole.weights = gather_lists<Real>(comm, graph.weights);
  whole.centres = gather_lists<Real>(comm, graph.centres);
  whole.neighbours = gather_lists<LocalId>(comm, neighbours);
  whole.edge_weights = gather_lists<std::int32_t>(comm, graph.edge_weights);
  whole.start.assign(1, 0);
  for (const std::int64_t degree : gather_lists<std::int64_t>(comm, degrees)) {
    whole.start.push_back(whole.start.back() + degree);
  }
  whole.ownership = Ownership(alone, whole.owned());
  whole.halo = Halo(alone, whole.ownership, {});
  return whole;
}

}  // namespace malleus
