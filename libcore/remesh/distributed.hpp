#pragma once

/// The remesher on a distributed mesh.
///
/// Each rank remeshes its own elements while the interfaces between ranks stay as they are; then the partition moves,
/// so that what was held is inside a rank, and only a strip of a few layers about it is remeshed again, until none is
/// left (cost: that of the strip). A small mesh is refined in stages on few ranks first, while the load spreads.

#include <functional>

#include "field/field.hpp"
#include "remesh/distributed_metric.hpp"
#include "remesh/remesh.hpp"

namespace malleus {

struct DistributedRemeshOptions {
  RemeshOptions local;                         ///< of each rank's remeshes
  int band_layers = 1;                         ///< elements on each side of a new interface, remeshed before the others
  int strip_rounds = 5;                        ///< at most, to remesh what interfaces held
  int moved_layers = 6;                        ///< how many elements far an interface moves
  int strip_layers = 4;                        ///< elements remeshed again on each side of a former interface
  GlobalId fewest_elements = 2000;             ///< a rank takes part once there are that many for it
  std::vector<char> kept_regions;              ///< [region] 1: its elements stay as they are; may be empty
  bool balances_by_cost = false;               ///< shares by balance_by_cost() at the end, not along the curve
  std::function<void(const char*)> announces;  ///< told each phase as it begins, on all ranks; may be empty
};

/// One pass of local remeshes: all elements, or a strip.
struct RemeshRound {
  GlobalId elements = 0;          ///< remeshed, over all ranks
  GlobalId largest_elements = 0;  ///< on one rank
  GlobalId moved_elements = 0;    ///< to another rank before it
  GlobalId sent_bytes = 0;
  Real remesh_s = 0;  ///< processor time of the slowest rank
};

struct DistributedRemeshReport {
  GlobalId nodes_before = 0, nodes_after = 0;
  GlobalId elements_before = 0, elements_after = 0;
  MetricFit before, after;
  Real volume_error = 0;  ///< with keep_volume: largest relative error of a region's volume on a rank
  GlobalId splits = 0, collapses = 0, swaps = 0, moves = 0;
  GlobalId interface_nodes = 0;     ///< nodes left about which interfaces never moved away
  std::vector<RemeshRound> rounds;  ///< in order; the first ones are of all elements
  std::vector<RemeshPhase> phases;  ///< wall time of the slowest rank
};

/// Brings the mesh to a metric given at its nodes (or uniform). Fields follow, references to them stay valid; copies of
/// node fields must be up to date. Groups, regions and their interfaces stay. On return the shares of the ranks are
/// equal. The same input on the same ranks gives the same bytes. InputError for non-manifold input. Collective.
DistributedRemeshReport remesh_distributed(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                                           const Metric& metric, const DistributedRemeshOptions& options = {});

}  // namespace malleus
