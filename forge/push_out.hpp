#pragma once

/// Surface nodes that a remesh left within a tool.

#include "forge/scene.hpp"

namespace malleus::forge {

/// Puts surface nodes of deformable bodies that lie within a tool, deeper than contacts do, onto its surface; along the
/// directions that boundary conditions leave free. A short step would push them out at a speed that the process does
/// not have. Nothing moves where an element would turn over. Collective.
void push_out_of_tools(Scene& scene);

}  // namespace malleus::forge
