#pragma once

/// The subcommands of meshtool, one file each.

#include <span>
#include <string>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus::meshtool {

/// A subcommand: reads its words, runs on all ranks, returns the exit code. Errors leave as exceptions.
struct Command {
  std::string name;
  std::string summary;  ///< one line for the list of commands
  int (*run)(const Communicator& comm, const std::vector<std::string>& arguments);
};

/// All subcommands, in the order in which they are listed.
std::span<const Command> commands();

int run_info(const Communicator& comm, const std::vector<std::string>& arguments);
int run_check(const Communicator& comm, const std::vector<std::string>& arguments);
int run_partition(const Communicator& comm, const std::vector<std::string>& arguments);
int run_probe(const Communicator& comm, const std::vector<std::string>& arguments);
int run_convert(const Communicator& comm, const std::vector<std::string>& arguments);
int run_refine(const Communicator& comm, const std::vector<std::string>& arguments);

/// meshtool [COMMAND] ...: what apps/meshtool.cpp runs. Returns the exit code.
int run_meshtool(int argc, char** argv);

}  // namespace malleus::meshtool
