#include "engine/resources.hpp"

#include <sys/resource.h>

#include <chrono>

namespace malleus {

Real wall_clock() {
  return std::chrono::duration<Real>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

namespace {
const Real program_start = wall_clock();
}

Real wall_since_program_start() {
  return wall_clock() - program_start;
}

GlobalId peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<GlobalId>(usage.ru_maxrss) * 1024;
}

}  // namespace malleus
