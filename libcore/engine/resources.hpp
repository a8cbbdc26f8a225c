#pragma once

/// Time and memory of the run.

#include "base/types.hpp"

namespace malleus {

Real wall_clock();                ///< monotonic, s: no setting of the clock moves it
Real wall_since_program_start();  ///< s since this process was loaded
GlobalId peak_memory_bytes();     ///< peak resident set of this process

/// Processor time of this rank since the start of the program, s.
Real processor_seconds();

}  // namespace malleus
