#include "engine/stop_request.hpp"

#include <unistd.h>

#include <array>
#include <csignal>
#include <ctime>

#include "base/error.hpp"

namespace malleus {
namespace {

volatile std::sig_atomic_t received_signal = 0;
timespec received_at{};
constexpr std::array<int, 4> stop_signals = {SIGUSR1, SIGUSR2, SIGTERM, SIGINT};
constexpr GlobalId stop_file = 1000;

/// One wish to stop can arrive as several signals: `timeout` and batch systems send to the process and to its group.
constexpr double same_wish_s = 0.5;

void on_signal(int number) {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (received_signal == 0) {
    received_at = now;
    received_signal = number;
    return;
  }
  const auto since = static_cast<double>(now.tv_sec - received_at.tv_sec) +
                     1e-9 * static_cast<double>(now.tv_nsec - received_at.tv_nsec);
  if (since > same_wish_s) _exit(exit_code::checkpointed);
}

std::string signal_name(GlobalId number) {
  switch (number) {
    case SIGUSR1:
      return "SIGUSR1";
    case SIGUSR2:
      return "SIGUSR2";
    case SIGTERM:
      return "SIGTERM";
    default:
      return "SIGINT";
  }
}

}  // namespace

void listen_for_stop_signals() {
  for (const int number : stop_signals) std::signal(number, on_signal);
}

StopRequest::StopRequest() {
  listen_for_stop_signals();
}

StopRequest::~StopRequest() {
  received_signal = 0;
  // A wish to stop that comes again once all is written must not end the program by itself.
  for (const int number : stop_signals) {
    std::signal(number, number == SIGUSR1 || number == SIGUSR2 ? SIG_IGN : SIG_DFL);
  }
}

std::string StopRequest::asked(const Communicator& comm, const std::filesystem::path& directory) const {
  GlobalId mine = received_signal;
  std::error_code ignored;
  if (comm.is_root() && mine == 0 && std::filesystem::remove(directory / "stop", ignored)) mine = stop_file;
  const GlobalId asked = comm.max(mine);
  if (asked == 0) return "";
  return asked == stop_file ? "file 'stop' found" : "signal " + signal_name(asked);
}

}  // namespace malleus
