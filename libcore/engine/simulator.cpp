#include "engine/simulator.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/log.hpp"
#include "base/text.hpp"
#include "case/help.hpp"
#include "engine/command_line.hpp"
#include "engine/engine.hpp"
#include "engine/load_mesh.hpp"
#include "engine/run_guarded.hpp"
#include "engine/stop_request.hpp"
#include "engine/targets.hpp"
#include "parallel/petsc_session.hpp"
#include "partition/balance.hpp"
#include "partition/scotch_start.hpp"
#include "remesh/distributed.hpp"

namespace malleus {
namespace {

std::string level_name(Level level) {
  return std::string(level_names[static_cast<std::size_t>(level)]);
}

/// Prints what was asked for instead of a run; whether anything was.
bool answer_questions(const Communicator& comm, const CommandLine& line, Simulator& simulator) {
  std::string answer = line.answer;
  if (answer.empty()) {
    CaseReader reader;
    simulator.describe(reader);
    if (line.help_case) answer = help_text(reader, *line.help_case);
    if (line.print_template) answer = template_text(reader, simulator.program());
    if (line.print_case_page) answer = markdown_page(reader, simulator.program());
  }
  if (answer.empty()) return false;
  if (comm.is_root()) fmt::print("{}\n", answer);
  return true;
}

std::filesystem::path output_directory(const CommandLine& line, const CommonSections& common) {
  if (!line.output.empty()) return line.output;
  if (!common.output.directory.empty()) return common.output.directory;
  return std::filesystem::path("out") / common.case_settings.name;
}

RunSettings run_settings(const CommandLine& line, Simulator& simulator) {
  const CommonSections& common = simulator.common();
  const TimeSettings& time = simulator.time();
  RunSettings settings;
  settings.program = simulator.program();
  settings.case_name = common.case_settings.name;
  settings.directory = output_directory(line, common);
  settings.level = level_name(common.accuracy.level);
  if (time.end) settings.end = *time.end;
  if (time.step) settings.step = *time.step;
  if (time.increments) settings.increments = *time.increments;
  settings.output_every = common.output.every;
  settings.precision = common.output.precision == Precision::float64 ? ResultWriter::Precision::float64
                                                                     : ResultWriter::Precision::float32;
  settings.output_fields = common.output.fields;
  settings.checkpoint_every_increments = common.checkpoint.every.increments;
  if (common.checkpoint.every.seconds) settings.checkpoint_every_wall_s = *common.checkpoint.every.seconds;
  if (common.limits.wall_time) settings.wall_time_limit_s = *common.limits.wall_time;
  if (common.limits.memory) settings.memory_limit_bytes = *common.limits.memory;
  settings.more_increments = line.steps;
  settings.restart = line.restart;
  settings.check_only = line.check;
  return settings;
}

/// Fields asked for that the scene does not have.
void check_output_fields(const Process& process, const CommonSections& common, CaseReader& reader) {
  const std::vector<std::string> known = process.output_fields();
  for (const std::string& name : common.output.fields) {
    const bool is_known =
        name == "region" || name == "partition" || std::find(known.begin(), known.end(), name) != known.end();
    if (!is_known) {
      reader.fail("output", "fields",
                  fmt::format("'{}' is no field of this scene{}; it has {}", name, did_you_mean(name, known),
                              fmt::join(known, ", ")));
    }
  }
}

/// Fields of probes that the scene does not have.
void check_probe_fields(Process& process, const CommonSections& common, CaseReader& reader) {
  const FieldStore& fields = process.fields();
  std::vector<std::string> known;
  for (const Field* field : fields.all()) known.push_back(field->spec().name);
  for (const ProbeSettings& probe : common.probes) {
    for (const std::string& name : probe.fields) {
      if (fields.has(name)) continue;
      reader.fail("probe." + probe.name, "fields",
                  fmt::format("'{}' is no field of this scene{}; it has {}", name, did_you_mean(name, known),
                              fmt::join(known, ", ")));
    }
  }
}

/// What of [partition] is not there.
void check_partition(const CommonSections& common, CaseReader& reader) {
  if (common.partition.method == PartitionMethod::scotch && !has_scotch()) {
    reader.fail("partition", "method",
                "scotch is not built in; cost and curve are (for PT-Scotch install libptscotch-dev and build again)");
  }
}

/// Rounding aside, no node of a scene that is revolved lies beyond its axis. Collective.
void refuse_negative_radii(const Communicator& comm, const Mesh& mesh, CaseReader& reader) {
  Real low = std::numeric_limits<Real>::max();
  Real high = -low;
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    low = std::min(low, mesh.point(node)[0]);
    high = std::max(high, mesh.point(node)[0]);
  }
  low = comm.min(low);
  high = comm.max(high);
  if (low >= -1e-9 * std::max(std::abs(low), std::abs(high))) return;
  reader.fail("case", "geometry",
              fmt::format("the mesh has r < 0: smallest x = {:.4g} m (x is r, the axis of revolution is x = 0)", low));
}

int run_scene(const Communicator& comm, Simulator& simulator, Mesh mesh, RunSettings settings, CaseReader& reader) {
  const CommonSections& common = simulator.common();
  if (common.case_settings.geometry == CaseGeometry::axisymmetric && mesh.dim == 2) {
    refuse_negative_radii(comm, mesh, reader);
  }
  const MeshNames names = {mesh.dim, mesh.region_names, mesh.group_names};
  const std::unique_ptr<Process> process = simulator.assemble(comm, std::move(mesh), reader);
  check_output_fields(*process, common, reader);
  check_probe_fields(*process, common, reader);
  reader.check_mesh(names);
  settings.resolved_case = reader.resolved(settings.directory);
  ProcessFactory on_mesh;
  if (common.accuracy.two_meshes) {
    on_mesh = [&](Mesh other) { return simulator.assemble(comm, std::move(other), reader); };
  }
  return Engine(comm, *process, std::move(settings), std::move(on_mesh)).run();
}

/// The mesh anew with its sizes times a factor. Collective.
void scale_sizes(const Communicator& comm, Mesh& mesh, FieldStore& fields, Real factor) {
  if (factor == 1) return;
  const GlobalId before = mesh.total_nodes();
  std::vector<Real> sizes = current_sizes(comm, mesh).values();
  for (Real& size : sizes) size *= factor;
  DistributedRemeshOptions options;
  options.local.keep_volume = true;
  remesh_distributed(comm, mesh, fields, Metric::per_node(std::move(sizes)), options);
  log::info("[accuracy] size_factor = {:.3g}: {} nodes where the file has {}", factor, mesh.total_nodes(), before);
}

/// With [accuracy] target_error or target_time: the settings that they lead to, of those that the case does not give
/// by itself. Collective.
std::vector<std::string> settings_for_targets(const Communicator& comm, Simulator& simulator, const Mesh& mesh,
                                              CaseReader& reader) {
  const AccuracySettings asked = simulator.common().accuracy;
  const bool gives_level = reader.file().find_entry("accuracy", "", "level") != nullptr;
  const bool gives_sizes = reader.file().find_entry("accuracy", "", "size_factor") != nullptr;
  if (!asked.has_targets() || (gives_level && gives_sizes)) return {};
  Expectation expected;
  std::optional<Outlook> outlook;
  {
    const std::unique_ptr<Process> process = simulator.assemble(comm, mesh, reader);
    SpaceEstimate trial(comm, [&](Mesh other) { return simulator.assemble(comm, std::move(other), reader); });
    const TimeSettings& time = simulator.time();
    RunPlan plan;
    if (time.step) plan.step = *time.step;
    if (time.end) plan.end = *time.end;
    plan.increments = time.increments;
    outlook = trial.look_ahead(*process, plan, asked.target_time ? seconds_of_rehearsal : 0);
    if (outlook) {
      expected.increments = outlook->increments;
      const Real processor_s = outlook->total_s(estimates_of_run(*process, plan));
      outlook->increment_s = processor_s / outlook->increments / comm.size();  // wall time
    }
    expected.dimension = mesh.dim;
    expected.steps_follow_sizes = process->steps_follow_sizes();
  }
  if (!outlook) {
    reader.fail("accuracy", asked.target_error ? "target_error" : "target_time",
                "the mesh is so coarse that no coarser one can be tried: give size_factor and level by themselves");
    reader.finish();
  }
  expected.outlook = *outlook;
  const Choice choice = choose_for(asked, expected);
  log::info("{}", choice.reason);
  std::vector<std::string> settings;
  if (!gives_sizes) settings.push_back(fmt::format("accuracy.size_factor={:.4g}", choice.size_factor));
  if (!gives_level) settings.push_back("accuracy.level=" + level_name(choice.level));
  return settings;
}

/// chosen: SECTION.KEY=VALUE that the targets of the case led to, besides what it gives.
int run_case(const Communicator& comm, const CommandLine& line, Simulator& simulator,
             const std::vector<std::string>& chosen = {}) {
  simulator.forget();
  CommonSections& common = simulator.common();
  common.case_settings.name = line.case_file.stem().string();
  CaseFile file = CaseFile::read(comm, line.case_file, line.overrides);
  for (const std::string& setting : chosen) file.set(setting, "chosen for the targets of [accuracy]");
  CaseReader reader(comm, std::move(file));
  simulator.describe(reader);
  reader.finish();
  FieldStore file_fields;
  Mesh mesh = load_mesh(comm, common.mesh.file, common.mesh.length_scale(), file_fields);
  if (common.case_settings.geometry == CaseGeometry::axisymmetric && mesh.dim == 3) {
    reader.fail("case", "geometry", "axisymmetric scenes want a mesh of two dimensions; this one has three");
  }
  check_partition(common, reader);
  const MeshNames names = {mesh.dim, mesh.region_names, mesh.group_names};
  reader.check_mesh(names);
  RunSettings settings = run_settings(line, simulator);
  try {
    const std::vector<std::string> settings_to_try = settings_for_targets(comm, simulator, mesh, reader);
    if (!settings_to_try.empty()) return run_case(comm, line, simulator, settings_to_try);
    scale_sizes(comm, mesh, file_fields, common.accuracy.size_factor);
  } catch (const InputError& error) {
    throw InputError(reader.located(error.what()));
  }
  if (common.partition.method != PartitionMethod::curve && comm.size() > 1) {
    const PartitionStart start =
        common.partition.method == PartitionMethod::scotch ? PartitionStart::scotch : PartitionStart::best;
    log::say(describe_balance(balance_by_cost(comm, mesh, file_fields, solver_work(), true, start)));
  }
  try {
    return run_scene(comm, simulator, std::move(mesh), std::move(settings), reader);
  } catch (const InputError& error) {
    throw InputError(reader.located(error.what()));
  }
}

}  // namespace

int answer(const Communicator& comm, Simulator& simulator, const std::vector<std::string>& arguments) {
  const CommandLine line = parse_command_line(simulator.program(), simulator.description(), arguments);
  log::start(comm.is_root(), line.quiet ? log::Level::quiet : line.verbose ? log::Level::verbose : log::Level::normal);
  if (answer_questions(comm, line, simulator)) return exit_code::done;
  return run_case(comm, line, simulator);
}

int run_simulator(int argc, char** argv, Simulator& simulator) {
  const auto program = [&](const Communicator& comm, const std::vector<std::string>& arguments) {
    listen_for_stop_signals();
    return answer(comm, simulator, arguments);
  };
  return run_guarded(argc, argv, program, start_petsc);
}

}  // namespace malleus
