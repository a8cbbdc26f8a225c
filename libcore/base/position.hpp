#pragma once

#include <array>

#include "base/types.hpp"

namespace malleus {

using Position = std::array<Real, 3>;  ///< x, y, z [m]; z = 0 in 2D

}  // namespace malleus
