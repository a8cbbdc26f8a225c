#pragma once

/// Metrics on a distributed mesh: values at its nodes in local order, alike on all holders of a node.

#include "mesh/mesh.hpp"
#include "remesh/metric_tools.hpp"

namespace malleus {

/// Mean length of the edges at each node, each edge counted once for each element at it [m]. Collective.
Metric current_sizes(const Communicator& comm, const Mesh& mesh);

/// limit_gradation() over all ranks: limits each rank's part, takes the smaller sizes over the interfaces, until
/// nothing changes. Collective.
void limit_gradation(const Communicator& comm, const Mesh& mesh, Metric& metric, Real beta);

/// Number of elements that a remesh should make. Collective.
Real predicted_elements(const Communicator& comm, const Mesh& mesh, const Metric& metric);

/// Scales all sizes by one factor such that a remesh should make about this many nodes, none of them outside
/// [smallest, largest] [m]; where the bounds forbid that number, as near to it as they allow. Collective.
void scale_to_nodes(const Communicator& comm, const Mesh& mesh, Metric& metric, Real nodes, Real smallest = 1e-100,
                    Real largest = 1e100);

/// How well a mesh fits a metric. Quality: the mean ratio in metric space, 1 regular, 0 flat; lengths of edges in
/// metric space, 1 ideal. The same on all ranks.
struct MetricFit {
  Real quality_min = 0;
  Real quality_mean = 0;
  Real quality_p01 = 0;  ///< one per cent of the elements are worse, to within 1/1000
  Real conforming = 0;   ///< share of edges of length in [1/sqrt 2, sqrt 2]; edges between ranks count on each
  Real edge_min = 0;
  Real edge_max = 0;
  Real volume = 0;        ///< of the mesh [m^dim]
  GlobalId inverted = 0;  ///< elements of volume <= 0
};

/// Collective.
MetricFit metric_fit(const Communicator& comm, const Mesh& mesh, const Metric& metric);

/// What an element has to be for a remesh to leave it: a little wider than what a remesh aims at.
struct FitBounds {
  Real least_quality = 0.6;  ///< mean ratio in the metric, 0..1
  Real shortest = 0.35;      ///< of an edge, squared, in the metric
  Real longest = 2.6;        ///< likewise
};
/// Elements out of bounds: [element] 1 or 0. Local.
std::vector<std::uint8_t> misfits(const Mesh& mesh, const Metric& metric, const FitBounds& bounds);

}  // namespace malleus
