#include "engine/resources.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <fstream>

namespace malleus {

Real wall_clock() {
  return std::chrono::duration<Real>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

GlobalId peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<GlobalId>(usage.ru_maxrss) * 1024;
}

GlobalId current_memory_bytes() {
  std::ifstream statm("/proc/self/statm");
  GlobalId total = 0;
  GlobalId resident = 0;
  statm >> total >> resident;
  return resident * static_cast<GlobalId>(sysconf(_SC_PAGESIZE));
}

}  // namespace malleus
