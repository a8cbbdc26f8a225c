#include "engine/run_guarded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <new>
#include <thread>

#include "base/error.hpp"
#include "parallel/fault.hpp"
#include "parallel/session.hpp"

namespace malleus {
namespace {

constexpr auto patience = std::chrono::seconds(10);

/// Whether all ranks come here too, within some seconds. Not on the program's communicator: ranks may be anywhere.
bool everyone_arrives(const Communicator& guard) {
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibarrier(guard.raw(), &request);
  const auto began = std::chrono::steady_clock::now();
  for (int arrived = 0; arrived == 0;) {
    MPI_Test(&request, &arrived, MPI_STATUS_IGNORE);
    if (arrived == 0 && std::chrono::steady_clock::now() - began > patience) return false;
    if (arrived == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

void print_error(const std::string& message) {
  std::fflush(stdout);
  fmt::print(stderr, "error: {}\n", message);
  std::fflush(stderr);
}

int leave_with(const Communicator& guard, const Error& error) {
  const bool is_common = everyone_arrives(guard);
  if (!is_common || guard.is_root()) print_error(error.what());
  if (!is_common) MPI_Abort(MPI_COMM_WORLD, error.code());
  return error.code();
}

int leave_with_defect(const Communicator& guard, const char* message) {
  print_error(fmt::format("defect on rank {}: {}", guard.rank(), message));
  MPI_Abort(MPI_COMM_WORLD, exit_code::defect);
  return exit_code::defect;
}

}  // namespace

int run_guarded(int argc, char** argv, const Program& program, StartPetsc* start_petsc) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  const auto separator = start_petsc != nullptr ? std::find(words.begin(), words.end(), "--") : words.end();
  const std::vector<std::string> arguments(words.begin(), separator);
  const std::vector<std::string> petsc_options(separator == words.end() ? separator : separator + 1, words.end());
  int own_argc = 1;
  Session session(own_argc, argv);
  std::shared_ptr<PetscSession> petsc;
  if (start_petsc != nullptr) petsc = start_petsc(argv[0], petsc_options);
  const Communicator guard(session.world().raw());
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may grow no more is an error that write() returns
  std::signal(SIGPIPE, SIG_IGN);  // a terminal or a reader that has gone ends no run
  set_fault_rank(guard.rank());
  try {
    return program(session.world(), arguments);
  } catch (const Error& error) {
    return leave_with(guard, error);
  } catch (const std::bad_alloc&) {
    return leave_with_defect(guard, "out of memory");
  } catch (const std::exception& error) {
    return leave_with_defect(guard, error.what());
  }
}

}  // namespace malleus
