#pragma once

/// Which of the ranks that hold a node owns it: nodes between ranks go to those that have less to do.

#include <span>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// What a node is worth in elements when work is shared out. Measured on this program's own solver: 16 in the housing
/// case (31 289 nodes; assembly 2.5 us an element, set-up and solve 39 us a node), 18 to 22 in lid cavities of 9 000
/// and 39 000 nodes (scripts/measure-work: 0.95 us, 17 to 21 us).
inline constexpr Real node_work_in_elements = 16;

/// Nodes that other ranks hold, too.
struct SharedNodes {
  std::vector<GlobalId> numbers;          ///< any numbers on which the holders agree, distinct
  std::vector<std::vector<int>> holders;  ///< [node] ranks, this one among them, increasing
};

/// The owner of each shared node, one of its holders, alike on all of them: such that elements and owned nodes together
/// come out even. load: of this rank in nodes, those that it holds alone and its elements. Nodes of the same holders
/// are dealt in stretches of the order in which their lowest holder lists them. Cost: the size of the interfaces; a few
/// exchanges between neighbours. Collective.
std::vector<int> choose_node_owners(const Communicator& comm, const SharedNodes& shared, Real load);

}  // namespace malleus
