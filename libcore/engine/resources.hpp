#pragma once

/// Time and memory of the run.

#include "base/types.hpp"

namespace malleus {

Real wall_clock();                ///< monotonic, s
GlobalId peak_memory_bytes();     ///< peak resident set of this process
GlobalId current_memory_bytes();  ///< resident set of this process

}  // namespace malleus
