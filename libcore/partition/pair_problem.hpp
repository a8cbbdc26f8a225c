#pragma once

/// Two parts and the vertices along their common border: the serial heart of the refinement.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// A band of vertices that may change between two parts; everything else stays. Side 0 is the first part, 1 the second.
struct PairProblem {
  std::vector<Real> weights;                 ///< [vertex]
  std::vector<std::uint8_t> sides;           ///< [vertex] 0 or 1
  std::vector<std::array<Real, 2>> outside;  ///< [vertex] edge weights to vertices of each side outside the band
  std::vector<Real> third;                   ///< [vertex] cost saved with all other parts by going from side 0 to 1
  std::vector<std::int64_t> start;           ///< [vertex + 1]
  std::vector<LocalId> neighbours;           ///< in the band
  std::vector<std::int32_t> edge_weights;

  Real link_cost = 1;                  ///< cost of a cut edge of weight 1 between the two
  std::array<Real, 2> loads = {0, 0};  ///< weight of each part, the band included
  std::array<Real, 2> aims = {0, 0};   ///< wanted
  std::array<Real, 2> slack = {0, 0};  ///< by which a part may exceed its aim

  std::size_t size() const noexcept { return weights.size(); }
};

/// Moves vertices between the sides to bring the loads below aim + slack first, then to lower the cost of cut edges:
/// passes of Fiduccia and Mattheyses (1982), each undone back to its best point, ended `stall` moves after it. sides
/// and loads are changed. Returns how many vertices changed side. Local; the same problem gives the same sides.
LocalId refine_pair(PairProblem& problem, int passes, int stall);

}  // namespace malleus
