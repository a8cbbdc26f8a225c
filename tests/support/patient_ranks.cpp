/// A rank that waits for others sleeps a moment instead of asking again at once. With more ranks than idle cores, ranks
/// that only give their turn away keep the cores busy with that: a run of three ranks on two busy cores took six times
/// as long. Loaded into every run of a test; Open MPI asks here where mpi_yield_when_idle is set.

#include <ctime>

extern "C" int sched_yield() {
  const timespec moment = {0, 20000};
  nanosleep(&moment, nullptr);
  return 0;
}
