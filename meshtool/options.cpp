#include "meshtool/options.hpp"

#include <fmt/format.h>

#include "base/error.hpp"

namespace malleus::meshtool {

bool parse_options(const Communicator& comm, CLI::App& app, const std::vector<std::string>& arguments) {
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::CallForHelp&) {
    if (comm.is_root()) fmt::print("{}", app.help());
    return false;
  } catch (const CLI::ParseError& error) {
    throw InputError(fmt::format("command line: {} (see {} --help)", error.what(), app.get_name()));
  }
  return true;
}

}  // namespace malleus::meshtool
