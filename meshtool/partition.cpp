#include "partition/partition.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "engine/resources.hpp"
#include "mesh/statistics.hpp"
#include "meshtool/commands.hpp"
#include "meshtool/element_list.hpp"
#include "meshtool/mesh_files.hpp"
#include "meshtool/options.hpp"
#include "parallel/agreement.hpp"
#include "partition/interface_release.hpp"
#include "partition/migrate.hpp"
#include "storage/atomic_file.hpp"
#include "storage/mesh_file.hpp"

namespace malleus::meshtool {
namespace {

struct PartitionCommand {
  std::string input;
  std::string output;
  int parts = 0;
  std::string architecture;
  WorkModel model;
  std::string weights;
  std::string from;
  std::string parts_file;
  std::string report;
  std::string method = "refined";
  std::string start = "best";
  std::string release;
  PartitionOptions options;
  Real length_unit = 1;
};

void add_options(CLI::App& app, PartitionCommand& c) {
  app.add_option("IN", c.input, "The mesh: " + mesh_endings())->required();
  app.add_option("OUT", c.output, "The file to write: " + mesh_endings() + "; .h5 holds each part apart")->required();
  app.add_option("--parts", c.parts, "Number of parts, whatever the number of ranks")
      ->required()
      ->check(CLI::Range(1, 1 << 20))
      ->type_name("N");
  app.add_option("--architecture", c.architecture, "Speeds and links of the processors (default: all equal)")
      ->type_name("FILE.ini");
  app.add_option("--element-weight", c.model.element, "Work per element (default 1)")
      ->check(CLI::Range(0.0, 1e300))
      ->type_name("W");
  app.add_option("--node-weight", c.model.node,
                 "Work per node (default 16, as this program's solver; 100: the paper's)")
      ->check(CLI::Range(0.0, 1e300))
      ->type_name("W");
  app.add_option("--communication-weight", c.model.communication,
                 "Data per cut face and mesh edge, in units of work at bandwidth 1 (default 1)")
      ->check(CLI::Range(0.0, 1e300))
      ->type_name("W");
  app.add_option("--weights", c.weights,
                 "Relative work of each element: a scalar element field of IN, or a text file with a number a line")
      ->type_name("FIELD");
  app.add_option("--from", c.from, "The present partition, a part number a line: repairs it in place of starting anew")
      ->type_name("FILE.txt");
  app.add_option("--parts-file", c.parts_file, "Writes a part number a line, in the order of the elements of IN")
      ->type_name("FILE.txt");
  app.add_option("--report", c.report, "Writes measures and times as JSON")->type_name("FILE.json");
  app.add_option("--method", c.method,
                 "refined (default), curve, strips (the paper's algorithm), or keep: the partition of --from as it is")
      ->check(CLI::IsMember({"refined", "curve", "strips", "keep"}));
  app.add_option("--start", c.start,
                 "What a new partition is refined from: best (default: of the next four that of least cut), curve, "
                 "coordinate, inertial, growth, or scotch (PT-Scotch)")
      ->check(CLI::IsMember({"best", "curve", "coordinate", "inertial", "growth", "scotch"}));
  app.add_option("--release", c.release,
                 "With --from: moves the borders between the parts inside them, as a remesher wants; balanced, or "
                 "shifted by a layer whatever the loads")
      ->check(CLI::IsMember({"balanced", "shifted"}));
  app.add_option("--tolerance", c.options.tolerance, "Imbalance of the work aimed at (default 0.01)")
      ->check(CLI::Range(1e-6, 1.0));
  app.add_option("--length-unit", c.length_unit, "Metres per unit of length in IN (default 1)")
      ->check(CLI::PositiveNumber);
}

void refuse_bad_factors(const Communicator& comm, const std::string& weights, std::span<const Real> factors) {
  agree(comm, [&] {
    for (const Real factor : factors) {
      if (factor >= 0 && std::isfinite(factor)) continue;
      throw InputError(fmt::format("--weights {}: holds {}; weights are finite and >= 0", weights, factor));
    }
  });
}

std::vector<Real> read_factors(const Communicator& comm, const Mesh& mesh, const FieldStore& fields,
                               const std::string& weights) {
  std::vector<Real> factors;
  if (fields.has(weights)) {
    const Field& field = fields[weights];
    if (field.spec().support != Support::element || field.components() != 1) {
      throw InputError(fmt::format("--weights {}: the field is no scalar per element", weights));
    }
    factors.assign(field.values().begin(), field.values().end());
  } else {
    try {
      factors = read_element_list(comm, mesh, weights);
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("--weights {}: the mesh has no such field, and as a file: {}", weights, error.what()));
    }
  }
  refuse_bad_factors(comm, weights, factors);
  return factors;
}

std::vector<int> read_parts(const Communicator& comm, const Mesh& mesh, const std::string& path, int parts) {
  const std::vector<Real> numbers = read_element_list(comm, mesh, path);
  agree(comm, [&] {
    for (const Real number : numbers) {
      if (number >= 0 && number < parts && number == std::floor(number)) continue;
      throw InputError(fmt::format("{}: holds {}; parts are whole numbers from 0 to {}", path, number, parts - 1));
    }
  });
  return {numbers.begin(), numbers.end()};
}

/// Brings each part to the rank that writes it; returns the parts of the elements as they lie then.
std::vector<int> gather_parts(const Communicator& comm, Mesh& mesh, FieldStore& fields, std::span<const int> parts,
                              int n_parts) {
  Field& field = fields.declare(mesh, {"partition", "1", Support::element, 1, Transfer::recompute});
  field.assign({parts.begin(), parts.end()});
  std::vector<int> destinations(parts.size());
  std::vector<int> rank_of_part(static_cast<std::size_t>(n_parts));
  for (int rank = 0; rank < comm.size(); ++rank) {
    for (int p = first_part_of_rank(n_parts, rank, comm.size()); p < first_part_of_rank(n_parts, rank + 1, comm.size());
         ++p) {
      rank_of_part[static_cast<std::size_t>(p)] = rank;
    }
  }
  for (std::size_t e = 0; e < parts.size(); ++e) destinations[e] = rank_of_part[static_cast<std::size_t>(parts[e])];
  migrate(comm, mesh, fields, destinations);
  return {field.values().begin(), field.values().end()};
}

nlohmann::json cost_json(const PartitionCost& cost) {
  return {{"imbalance", cost.imbalance},
          {"node_imbalance", cost.node_imbalance},
          {"cut", cost.cut},
          {"cut_edges", cost.cut_edges},
          {"cut_couplings", cost.cut_couplings},
          {"communication_volume", cost.communication_volume},
          {"largest_volume", cost.largest_volume},
          {"interface_nodes", cost.interface_nodes},
          {"max_neighbours", cost.max_neighbours},
          {"mean_neighbours", cost.mean_neighbours},
          {"empty_parts", cost.empty_parts},
          {"stray_pieces", cost.stray_pieces}};
}

nlohmann::json report_json(const PartitionPlan& plan, const MeshStatistics& mesh, int parts,
                           const std::map<std::string, Real>& wall, GlobalId memory) {
  Real seconds = 0;
  for (const auto& [phase, time] : plan.seconds) seconds += phase == "evaluate" ? 0 : time;
  nlohmann::json report = cost_json(plan.after);
  report["parts"] = parts;
  report["nodes"] = mesh.nodes;
  report["elements"] = mesh.elements;
  report["cost"] = {{"before", plan.before.cost}, {"after", plan.after.cost}};
  report["before"] = cost_json(plan.before);
  report["ideal_time"] = plan.after.ideal_time;
  report["moved"] = plan.moved;
  report["moved_elements"] = plan.moved_elements;
  report["made_by"] = plan.made_by;
  report["refinement"] = {{"rounds", plan.count.rounds},     {"flow_rounds", plan.count.flow_rounds},
                          {"pairs", plan.count.pairs},       {"moved_vertices", plan.count.moved_vertices},
                          {"messages", plan.count.messages}, {"bytes", plan.count.bytes}};
  report["seconds"] = seconds;
  report["processor_seconds"] = plan.processor_seconds;
  report["graph_processor_seconds"] = plan.graph_processor_seconds;
  report["phases"] = plan.seconds;
  report["wall_s"] = wall;
  report["peak_memory_bytes"] = memory;
  report["quality"] = {{"min", mesh.quality.min}, {"mean", mesh.quality.mean}, {"p01", mesh.quality.p01}};
  report["volume"] = {{"before", mesh.volume}, {"after", mesh.volume}};
  return report;
}

/// Not the cheapest partition, but the present one with its borders moved inside.
PartitionPlan release_plan(const Communicator& comm, const Mesh& mesh, const PartitionCommand& command,
                           const Architecture& architecture, std::span<const int> from) {
  const auto start = std::chrono::steady_clock::now();
  const std::vector<Real> work = element_work(comm, mesh, command.model);
  ReleaseOptions options;
  options.tolerance = command.options.tolerance;
  options.aim = command.release == "balanced" ? ReleaseAim::equal_loads : ReleaseAim::most_released;
  Release release = move_interfaces_inside(comm, mesh, work, architecture, from, options);
  PartitionPlan plan;
  plan.parts = std::move(release.parts);
  plan.seconds["divide"] = comm.max(std::chrono::duration<Real>(std::chrono::steady_clock::now() - start).count());
  const WorkGraph graph = build_work_graph(comm, mesh, work);
  plan.before = partition_cost(comm, mesh, graph, command.model, architecture, from);
  plan.after = partition_cost(comm, mesh, graph, command.model, architecture, plan.parts);
  plan.moved_elements = release.moved_elements;
  plan.moved = static_cast<Real>(release.moved_elements) / static_cast<Real>(mesh.total_elements);
  plan.made_by = fmt::format("release of {} of {} interface nodes", release.interface_nodes - release.still,
                             release.interface_nodes);
  return plan;
}

/// Wall time of the steps of a command.
class StepClock {
 public:
  void end(const Communicator& comm, const std::string& step) {
    const auto now = std::chrono::steady_clock::now();
    wall[step] += comm.max(std::chrono::duration<Real>(now - start_).count());
    start_ = now;
  }
  std::map<std::string, Real> wall;

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void write_result(const Communicator& comm, const PartitionCommand& command, Mesh& mesh, FieldStore& fields,
                  const PartitionPlan& plan, StepClock& clock) {
  if (!command.parts_file.empty()) write_element_list(comm, mesh, command.parts_file, plan.parts);
  clock.end(comm, "write");
  const std::vector<int> parts = gather_parts(comm, mesh, fields, plan.parts, command.parts);
  clock.end(comm, "move");
  if (command.output.ends_with(".h5")) {
    write_mesh_file(comm, command.output, mesh, fields, parts, command.parts);
  } else {
    write_mesh(comm, mesh, fields, command.output);
  }
  clock.end(comm, "write");
}

}  // namespace

int run_partition(const Communicator& comm, const std::vector<std::string>& arguments) {
  CLI::App app("Divides a mesh among processors so that an increment takes the least time, or repairs a division.",
               "meshtool partition");
  PartitionCommand command;
  add_options(app, command);
  if (!parse_options(comm, app, arguments)) return exit_code::done;
  refuse_unknown_ending(command.output);
  if (!command.release.empty() && command.from.empty()) throw InputError("command line: --release wants --from");
  const std::map<std::string, Partitioner> methods = {{"refined", Partitioner::refined},
                                                      {"curve", Partitioner::curve},
                                                      {"strips", Partitioner::strips},
                                                      {"keep", Partitioner::keep}};
  command.options.method = methods.at(command.method);
  const std::map<std::string, PartitionStart> starts = {{"best", PartitionStart::best},
                                                        {"curve", PartitionStart::curve},
                                                        {"coordinate", PartitionStart::coordinate},
                                                        {"inertial", PartitionStart::inertial},
                                                        {"growth", PartitionStart::growth},
                                                        {"scotch", PartitionStart::scotch}};
  command.options.start = starts.at(command.start);
  if (command.method == "keep" && command.from.empty()) throw InputError("command line: --method keep wants --from");
  const Architecture architecture = command.architecture.empty()
                                        ? equal_architecture(command.parts)
                                        : read_architecture(comm, command.architecture, command.parts);
  StepClock clock;
  FieldStore fields;
  Mesh mesh = read_mesh(comm, command.input, command.length_unit, fields);
  if (!command.weights.empty()) command.model.factor = read_factors(comm, mesh, fields, command.weights);
  std::vector<int> from;
  if (!command.from.empty()) from = read_parts(comm, mesh, command.from, command.parts);
  clock.end(comm, "read");
  const PartitionPlan plan = !command.release.empty()
                                 ? release_plan(comm, mesh, command, architecture, from)
                                 : make_partition(comm, mesh, command.model, architecture, command.options, from);
  clock.end(comm, "partition");
  write_result(comm, command, mesh, fields, plan, clock);
  const MeshStatistics statistics = mesh_statistics(comm, mesh);
  const GlobalId memory = comm.sum(peak_memory_bytes());
  if (comm.is_root()) fmt::print("{}", describe_plan(plan));
  if (!command.report.empty()) {
    on_root(comm, [&] {
      write_file_atomically(command.report,
                            report_json(plan, statistics, command.parts, clock.wall, memory).dump(2) + "\n");
    });
  }
  return exit_code::done;
}

}  // namespace malleus::meshtool
