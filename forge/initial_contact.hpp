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

/// A body that lies within a rigid tool from the start.
struct Swallowed {
  std::size_t tool = 0;
  std::string body;
  Real depth = 0;  ///< m, of its deepest node
};

/// Deformable bodies of which no node is out of a tool, and one deeper than half an edge. A tool whose surface may be
/// open swallows what touches it only: far away its sides are not told apart. Collective.
std::vector<Swallowed> find_swallowed(Scene& scene, const std::vector<char>& may_be_open);

/// Tells the log the gaps, and warns of overlaps: the first increment pushes them out, which makes a force that the
/// process does not have. Collective.
void report_clearances(Scene& scene);

}  // namespace malleus::forge
