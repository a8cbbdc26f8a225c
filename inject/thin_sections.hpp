#pragma once

/// Sections of the cavity with too few elements across.

#include "inject/scene.hpp"

namespace malleus::inject {

/// Shares of the cavity's volume by the elements that lie across, between walls on which the fluid stands still.
struct ThinSections {
  Real below_two = 0;   ///< no node off the walls: nothing can flow there
  Real below_four = 0;  ///< pressure drop wrong by 6 % (3 across) to 31 % (2 across); the former included
};

/// Layers of nodes are counted from the walls through edges; a section has 4 elements across where some node is two
/// layers from any wall. Collective.
ThinSections find_thin_sections(const Scene& scene);

/// Warns of them.
void warn_of(const ThinSections& thin);

}  // namespace malleus::inject
