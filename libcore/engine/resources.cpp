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

Real processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<Real>(time.tv_sec) + 1e-6 * static_cast<Real>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace malleus
