#include <fmt/format.h>

#include "base/error.hpp"
#include "meshtool/commands.hpp"
#include "meshtool/options.hpp"
#include "parallel/agreement.hpp"
#include "partition/machine_probe.hpp"
#include "storage/atomic_file.hpp"

namespace malleus::meshtool {

int run_probe(const Communicator& comm, const std::vector<std::string>& arguments) {
  CLI::App app("Measures the speeds of the processors and the bandwidths of the links between them.", "meshtool probe");
  std::string output;
  ProbeOptions options;
  app.add_option("OUT", output, "The architecture file to write, for meshtool partition --architecture")->required();
  app.add_option("--seconds", options.seconds, "Time spent on the speeds (default 0.5)")
      ->check(CLI::Range(0.01, 600.0));
  app.add_option("--node-weight", options.node_weight, "Work per node that the bandwidths refer to (default 16)")
      ->check(CLI::PositiveNumber);
  if (!parse_options(comm, app, arguments)) return exit_code::done;
  const MachineProbe probe = probe_machine(comm, options);
  const std::string text = architecture_text(probe);
  on_root(comm, [&] { write_file_atomically(output, text); });
  if (comm.is_root()) fmt::print("{}", text);
  return exit_code::done;
}

}  // namespace malleus::meshtool
