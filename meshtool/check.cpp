#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"
#include "mesh/soundness.hpp"
#include "mesh/statistics.hpp"
#include "meshtool/commands.hpp"
#include "meshtool/mesh_files.hpp"
#include "meshtool/options.hpp"

namespace malleus::meshtool {
namespace {

void print_problems(const std::string& file, const std::vector<MeshProblem>& problems) {
  for (const MeshProblem& problem : problems) {
    fmt::print("{}: {}: {}\n", file, problem.is_fault ? problem.kind : "note", problem.message);
  }
}

}  // namespace

int run_check(const Communicator& comm, const std::vector<std::string>& arguments) {
  CLI::App app(
      "Lists what is wrong with a mesh: elements that do not match or overlap at faces, hanging nodes, boundaries "
      "that\n"
      "are not manifold, inverted and flat elements, nodes and elements given twice, unused nodes, coincident nodes "
      "of\n"
      "one body, boundary without a group. Exit code 2 where there is anything.",
      "meshtool check");
  std::string file;
  Real length_unit = 1;
  app.add_option("MESH", file, "The mesh: " + mesh_endings())->required();
  app.add_option("--length-unit", length_unit, "Metres per unit of length in the file (default 1)")
      ->check(CLI::PositiveNumber);
  if (!parse_options(comm, app, arguments)) return exit_code::done;
  const DistributedPiece distributed = distribute_mesh(comm, read_chunk(comm, file, length_unit));
  const std::vector<MeshProblem> problems = find_problems(comm, distributed);
  const GlobalId elements = comm.sum(GlobalId{distributed.piece.elements()});
  const auto faults = std::count_if(problems.begin(), problems.end(), [](const MeshProblem& p) { return p.is_fault; });
  if (comm.is_root()) print_problems(file, problems);
  if (faults == 0) {
    if (comm.is_root()) fmt::print("{}: sound: {} elements\n", file, elements);
    return exit_code::done;
  }
  throw InputError(
      fmt::format("{}: the mesh is not sound: {} kind{} of problem", file, faults, faults == 1 ? "" : "s"));
}

}  // namespace malleus::meshtool
