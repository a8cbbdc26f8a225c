#pragma once

/// What a partition costs: the paper's F and the usual measures, for any number of parts on any number of ranks.

#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

/// All measures of a partition; the same on all ranks.
struct PartitionCost {
  Real cost = 0;                      ///< F = max_p (t_p + C_p) / ideal, ideal = all work / sum of speeds
  Real ideal_time = 0;                ///< in units of work per speed
  Real imbalance = 0;                 ///< largest t_p by the elements' work over the ideal, minus 1
  Real node_imbalance = 0;            ///< the same of owned nodes
  GlobalId cut = 0;                   ///< faces between elements of different parts
  GlobalId cut_edges = 0;             ///< mesh edges between nodes of different parts
  GlobalId cut_couplings = 0;         ///< of the model, likewise
  GlobalId communication_volume = 0;  ///< sum over nodes of the parts around it, minus 1
  GlobalId largest_volume = 0;        ///< of one part
  GlobalId interface_nodes = 0;       ///< nodes of more than one part
  int max_neighbours = 0;             ///< parts with a node in common
  Real mean_neighbours = 0;
  int empty_parts = 0;
  GlobalId stray_pieces = 0;  ///< connected pieces of parts beyond the first of each
  std::vector<Real> times;    ///< [part] (t_p + C_p) / ideal
};

/// t_p = (work of the elements and owned nodes of p) / s_p, C_p = communication * (cut faces and mesh edges of p) /
/// v_pq (paper, sections 3.1.3.1 to 3.1.3.3; F is the largest sum over the parts). Where the model has factors,
/// elements carry the nodes' work. A node between parts belongs to the part around it that has least to do. parts:
/// [element] 0 <= part < architecture.parts(). Cost: local size. Collective.
PartitionCost partition_cost(const Communicator& comm, const Mesh& mesh, const WorkGraph& graph, const WorkModel& model,
                             const Architecture& architecture, std::span<const int> parts);

/// Work of each part's elements in units of the graph's weights: [part], the same on all ranks. Collective.
std::vector<Real> part_loads(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts, int n_parts);

}  // namespace malleus
