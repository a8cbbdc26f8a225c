#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/error.hpp"
#include "base/log.hpp"
#include "base/text.hpp"
#include "engine/command_line.hpp"
#include "engine/run_guarded.hpp"
#include "meshtool/commands.hpp"

namespace malleus::meshtool {
namespace {

std::string usage_text() {
  std::string text = "Usage: meshtool COMMAND [options] ...\n\nCommands:\n";
  for (const Command& command : commands()) text += fmt::format("  {:<10} {}\n", command.name, command.summary);
  return text +
         "\nmeshtool COMMAND --help tells about one of them; meshtool --version about the program.\n"
         "Exit codes: 0 done, 2 wrong input or an unsound mesh, 4 the disk failed.\n";
}

const Command& find_command(const std::string& name) {
  std::vector<std::string> names;
  for (const Command& command : commands()) {
    if (command.name == name) return command;
    names.push_back(command.name);
  }
  throw InputError(fmt::format("command line: unknown command '{}'{}; the commands are {}", name,
                               did_you_mean(name, names), join(names)));
}

int dispatch(const Communicator& comm, const std::vector<std::string>& arguments) {
  log::start(comm.is_root(), log::Level::normal);
  if (arguments.empty()) throw InputError("command line: a command is missing\n" + usage_text());
  const std::string& first = arguments.front();
  if (first == "--help" || first == "-h" || first == "help") {
    if (comm.is_root()) fmt::print("{}", usage_text());
    return exit_code::done;
  }
  if (first == "--version") {
    if (comm.is_root()) fmt::print("{}\n", version_text("meshtool"));
    return exit_code::done;
  }
  return find_command(first).run(comm, {arguments.begin() + 1, arguments.end()});
}

}  // namespace

std::span<const Command> commands() {
  static const std::array list = {
      Command{"info", "counts, groups, bounding box, volume, quality and edge lengths of a mesh", run_info},
      Command{"check", "lists what is wrong with a mesh; exit code 2 where it is not sound", run_check},
      Command{"convert", "writes a mesh, or meshes a CAD file, in another format", run_convert},
      Command{"refine", "brings a mesh to other sizes: finer, coarser, graded, anisotropic", run_refine},
      Command{"partition", "divides a mesh among equal or unequal processors", run_partition},
      Command{"probe", "measures the processors and links of this machine", run_probe},
  };
  return list;
}

int run_meshtool(int argc, char** argv) {
  return run_guarded(argc, argv, dispatch);
}

}  // namespace malleus::meshtool
