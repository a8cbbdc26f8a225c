#pragma once

/// How bodies, tools and each other stand at the start.

#include "forge/scene.hpp"

namespace malleus::forge {

/// Where a tool or a master stands before what may touch it.
struct Clearance {
  std::string opponent;                   ///< "tool upper", "contact lower"
  Real gap = 0;                           ///< smallest distance of a surface node, m; negative: the deepest overlap
  std::array<Real, 3> place = {0, 0, 0};  ///< of that node, m
  Real edge = 0;                          ///< mean edge of the body there, m
};

/// Smallest distances at the time of the scene's progress. Tools and contacts that nothing is near (farther than the
/// deformable bodies are high) are left out. Collective.
std::vector<Clearance> measure_clearances(Scene& scene);

/// Tells the log the gaps, and warns of overlaps: the first increment pushes them out, which makes a force that the
/// process does not have. Collective.
void report_clearances(Scene& scene);

}  // namespace malleus::forge
