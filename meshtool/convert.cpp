#include <fmt/format.h>

#include "base/error.hpp"
#include "meshtool/cad.hpp"
#include "meshtool/commands.hpp"
#include "meshtool/mesh_files.hpp"
#include "meshtool/options.hpp"

namespace malleus::meshtool {
namespace {

struct ConvertOptions {
  std::string input;
  std::string output;
  Real size = 0;  ///< 0: not given
  Real length_unit = 1;
  std::string msh_version = "4.1";
  bool ascii = false;
};

void add_options(CLI::App& app, ConvertOptions& options) {
  app.add_option("IN", options.input, "The mesh (" + mesh_endings() + ") or CAD file (.step, .stp, .brep, .geo)")
      ->required();
  app.add_option("OUT", options.output, "The file to write: " + mesh_endings())->required();
  app.add_option("--size", options.size, "Element size for CAD files, in their unit of length")
      ->check(CLI::PositiveNumber)
      ->type_name("H");
  app.add_option("--length-unit", options.length_unit, "Metres per unit of length in IN (default 1)")
      ->check(CLI::PositiveNumber);
  app.add_option("--msh-version", options.msh_version, "Version of .msh files (default 4.1)")
      ->check(CLI::IsMember({"2.2", "4.1"}));
  app.add_flag("--ascii", options.ascii, "Writes .msh as text (default: binary)");
}

Mesh read_input(const Communicator& comm, const ConvertOptions& options, FieldStore& fields) {
  if (is_cad_file(options.input)) {
    if (options.size <= 0) {
      throw InputError(
          fmt::format("command line: {} is a CAD file: give the element size with --size H", options.input));
    }
    return build_mesh(comm, mesh_cad_file(comm, options.input, options.size, options.length_unit));
  }
  if (options.size > 0) {
    throw InputError(
        fmt::format("command line: --size is for CAD files; {} is a mesh (see meshtool refine)", options.input));
  }
  return read_mesh(comm, options.input, options.length_unit, fields);
}

}  // namespace

int run_convert(const Communicator& comm, const std::vector<std::string>& arguments) {
  CLI::App app("Writes a mesh in another format, by the endings of the names; groups keep their names.",
               "meshtool convert");
  ConvertOptions options;
  add_options(app, options);
  if (!parse_options(comm, app, arguments)) return exit_code::done;
  refuse_unknown_ending(options.output);
  FieldStore fields;
  const Mesh mesh = read_input(comm, options, fields);
  write_mesh(comm, mesh, fields, options.output, {options.msh_version == "2.2" ? 2 : 4, !options.ascii});
  if (comm.is_root()) {
    fmt::print("{}: {} nodes, {} elements, {} regions, {} boundary groups\n", options.output, mesh.total_nodes(),
               mesh.total_elements, mesh.region_names.size(), mesh.group_names.size());
  }
  return exit_code::done;
}

}  // namespace malleus::meshtool
