#pragma once

/// Sections of the cavity with too few elements across.

#include "inject/scene.hpp"

namespace malleus::inject {

/// Shares of the cavity's volume by the elements that lie across, between walls on which the fluid stands still.
struct ThinSections {
  Real below_two = 0;   ///< no node off the walls: nothing can flow there
  Real below_four = 0;  ///< pressure drop wrong by up to 4 % (3 across), 15 % (2 across); the former included
};

/// The thickness at an element is twice the largest distance from the walls that a node within three edges of it has,
/// and half an element more, as the middle may lie between nodes. Collective.
ThinSections find_thin_sections(const Scene& scene);

/// Warns of them.
void warn_of(const ThinSections& thin);

}  // namespace malleus::inject
