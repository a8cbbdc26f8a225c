#pragma once

/// The command line of forge and inject.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/types.hpp"

namespace malleus {

struct CommandLine {
  std::filesystem::path case_file;
  std::filesystem::path output;        ///< empty: not given
  std::vector<std::string> overrides;  ///< SECTION.KEY=VALUE
  std::optional<GlobalId> steps;
  bool check = false;
  bool restart = false;
  bool quiet = false;
  bool verbose = false;
  std::optional<std::string> help_case;  ///< a section, or empty for all
  bool print_template = false;
  bool print_case_page = false;
  std::string answer;  ///< text to print instead of a run: --help, --version
};

/// Throws InputError where the words do not fit. Local.
CommandLine parse_command_line(const std::string& program, const std::string& description,
                               const std::vector<std::string>& arguments);

/// Version, compiler and libraries: what --version prints.
std::string version_text(const std::string& program);

}  // namespace malleus
