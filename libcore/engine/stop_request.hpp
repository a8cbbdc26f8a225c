#pragma once

/// Requests from outside to end a run early.

#include <filesystem>
#include <string>

#include "parallel/communicator.hpp"

namespace malleus {

/// From here on the signals below end nothing: the StopRequest that is constructed later knows of them. For the time in
/// which a program still reads its mesh. Local.
void listen_for_stop_signals();

/// From its construction SIGUSR1, SIGUSR2, SIGTERM and SIGINT ask for a stop at the end of the increment; a second
/// one, half a second or more after the first, ends the process at once with exit code 85: the newest complete
/// checkpoint is then an earlier one. One per process.
class StopRequest {
 public:
  StopRequest();
  ~StopRequest();
  StopRequest(const StopRequest&) = delete;
  StopRequest& operator=(const StopRequest&) = delete;

  /// The reason to stop, the same on all ranks; empty where there is none. Looks for a file `stop` in the directory
  /// too (and removes it). Collective.
  std::string asked(const Communicator& comm, const std::filesystem::path& directory) const;
};

}  // namespace malleus
