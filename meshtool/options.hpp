#pragma once

/// Command lines of subcommands.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus::meshtool {

/// Parses the words of a subcommand. Returns false where only help was asked for; the root has printed it then. Wrong
/// words are an InputError that names the command. Local but for the printing.
bool parse_options(const Communicator& comm, CLI::App& app, const std::vector<std::string>& arguments);

}  // namespace malleus::meshtool
