#include <fmt/format.h>
#include <mpi.h>

#include "base/error.hpp"
#include "base/log.hpp"
#include "meshtool/commands.hpp"
#include "meshtool/mesh_files.hpp"
#include "meshtool/options.hpp"
#include "meshtool/refine_metric.hpp"
#include "meshtool/refine_report.hpp"
#include "partition/balance.hpp"
#include "remesh/subdivide.hpp"

namespace malleus::meshtool {
namespace {

constexpr Real finer_with_volume = 1.3;  ///< a barrel's nodes then stay within 6e-5 of its surface where h / R = 0.08

void add_targets(CLI::App& app, RefineOptions& options) {
  app.add_option("IN", options.input, "The mesh: " + mesh_endings())->required();
  app.add_option("OUT", options.output, "The file to write: " + mesh_endings())->required();
  app.add_option("--size", options.size, "Edge length everywhere, in the unit of length of IN")
      ->check(CLI::PositiveNumber)
      ->type_name("H");
  app.add_option("--uniform", options.uniform, "Halves every edge N times; nothing else changes")
      ->check(CLI::Range(1, 20))
      ->type_name("N");
  app.add_option("--metric", options.metric,
                 "Sizes or symmetric tensors at the nodes of IN (.sol, .solb), in the order of IN's nodes")
      ->type_name("FILE");
  app.add_option("--nodes", options.nodes, "Scales the sizes to about N nodes")
      ->check(CLI::PositiveNumber)
      ->type_name("N");
  app.add_option("--error-of", options.error_of,
                 "With --nodes: spreads the interpolation error of this node field of IN (.h5) evenly")
      ->type_name("FIELD");
  app.add_flag("--anisotropic", options.anisotropic, "With --error-of: stretched elements");
}

void add_manners(CLI::App& app, RefineOptions& options) {
  app.add_option("--min-size", options.min_size, "Smallest size")->check(CLI::PositiveNumber)->type_name("H");
  app.add_option("--max-size", options.max_size, "Largest size")->check(CLI::PositiveNumber)->type_name("H");
  app.add_option("--gradation", options.gradation,
                 "Largest ratio of the sizes of neighbouring edges (default 1.3; 1: any)")
      ->check(CLI::Range(1.0, 1e6));
  app.add_option("--hausdorff", options.hausdorff, "Largest distance of boundary faces from IN's smooth surface")
      ->check(CLI::PositiveNumber)
      ->type_name("H");
  app.add_flag("--keep-surface", options.keep_surface, "Changes no boundary or interface face");
  app.add_flag("--keep-volume", options.keep_volume,
               "Restores each region's volume by a shift of curved free surfaces, which get edges 1.3 times shorter "
               "so that the shift is small");
  app.add_option("--report", options.report, "Writes counts, quality, times and memory")->type_name("FILE.json");
  app.add_option("--length-unit", options.length_unit, "Metres per unit of length in IN (default 1); OUT is in m")
      ->check(CLI::PositiveNumber);
  app.add_option("--msh-version", options.msh_version, "Version of .msh files (default 4.1)")
      ->check(CLI::IsMember({"2.2", "4.1"}));
  app.add_flag("--ascii", options.ascii, "Writes .msh as text (default: binary)");
}

void check_options(const RefineOptions& options) {
  const int targets = (options.size > 0 ? 1 : 0) + (options.uniform > 0 ? 1 : 0) + (options.metric.empty() ? 0 : 1) +
                      (options.nodes > 0 ? 1 : 0);
  if (targets != 1) {
    throw InputError(
        fmt::format("command line: {} --size H, --uniform N, --metric FILE and --nodes N: give one of them",
                    targets == 0 ? "the wanted sizes are missing;" : "more than one of"));
  }
  if (!options.error_of.empty() && options.nodes == 0)
    throw InputError("command line: --error-of FIELD wants --nodes N with it");
  if (options.anisotropic && options.error_of.empty())
    throw InputError("command line: --anisotropic is for --error-of FIELD (a metric file tells its own shapes)");
  if (options.min_size > 0 && options.max_size > 0 && options.min_size > options.max_size) {
    throw InputError(
        fmt::format("command line: --min-size {} is larger than --max-size {}", options.min_size, options.max_size));
  }
  refuse_unknown_ending(options.input);
  refuse_unknown_ending(options.output);
}

void scale_lengths(RefineOptions& options) {
  for (Real* length : {&options.size, &options.min_size, &options.max_size, &options.hausdorff})
    *length *= options.length_unit;
}

DistributedRemeshReport halve(const Communicator& comm, Mesh& mesh, FieldStore& fields, int times) {
  DistributedRemeshReport report;
  const Metric sizes = current_sizes(comm, mesh);
  report.nodes_before = mesh.total_nodes();
  report.elements_before = mesh.total_elements;
  report.before = metric_fit(comm, mesh, sizes);
  const Real start = MPI_Wtime();
  for (int n = 0; n < times; ++n) subdivide(comm, mesh, fields);
  balance_along_curve(comm, mesh, fields);
  report.phases.push_back({"subdivide", comm.max(MPI_Wtime() - start)});
  report.after = metric_fit(comm, mesh, current_sizes(comm, mesh));
  report.nodes_after = mesh.total_nodes();
  report.elements_after = mesh.total_elements;
  return report;
}

DistributedRemeshReport remesh(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                               const std::vector<GlobalId>& numbers, const RefineOptions& options) {
  const Metric metric = wanted_metric(comm, mesh, fields, numbers, options);
  log::info("{}: {} nodes, {} elements; about {:.0f} nodes to make", options.input, mesh.total_nodes(),
            mesh.total_elements, predicted_elements(comm, mesh, metric) / predicted_per_node(mesh.dim));
  DistributedRemeshOptions how;
  how.local.hausdorff = options.hausdorff;
  how.local.keep_surface = options.keep_surface;
  how.local.keep_volume = options.keep_volume;
  if (options.keep_volume) how.local.surface_finer = finer_with_volume;
  how.announces = [&](const char* phase) {
    if (std::string(phase) != "report") log::info("{} ...", phase);
  };
  return remesh_distributed(comm, mesh, fields, metric, how);
}

}  // namespace

int run_refine(const Communicator& comm, const std::vector<std::string>& arguments) {
  CLI::App app("Brings a mesh to other sizes; regions, boundary groups and their interfaces stay.", "meshtool refine");
  RefineOptions options;
  add_targets(app, options);
  add_manners(app, options);
  if (!parse_options(comm, app, arguments)) return exit_code::done;
  check_options(options);
  scale_lengths(options);
  FieldStore fields;
  std::vector<GlobalId> numbers;
  const Real start = MPI_Wtime();
  Mesh mesh = options.metric.empty()
                  ? read_mesh(comm, options.input, options.length_unit, fields, Folds::keep_for_repair)
                  : build_mesh(comm, read_chunk(comm, options.input, options.length_unit), &numbers);
  const Real read = MPI_Wtime();
  const DistributedRemeshReport report =
      options.uniform > 0 ? halve(comm, mesh, fields, options.uniform) : remesh(comm, mesh, fields, numbers, options);
  const Real done = MPI_Wtime();
  write_mesh(comm, mesh, fields, options.output, {options.msh_version == "2.2" ? 2 : 4, !options.ascii});
  const Real end = MPI_Wtime();
  report_refinement(comm, options, report, {{"read", comm.max(read - start)}, {"write", comm.max(end - done)}});
  return exit_code::done;
}

}  // namespace malleus::meshtool
