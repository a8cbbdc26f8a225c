#pragma once

/// The number types of the whole program; a variable is typed by the role of its value.

#include <cstdint>

namespace malleus {

using Real = double;            ///< physical quantities, always SI
using LocalId = std::int32_t;   ///< entity on this rank; -1 = none
using GlobalId = std::int64_t;  ///< entity over all ranks; -1 = none

}  // namespace malleus
