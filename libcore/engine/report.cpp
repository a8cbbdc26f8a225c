#include "engine/report.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/log.hpp"
#include "engine/resources.hpp"

namespace malleus::report {
namespace {

std::vector<std::string> plan_lines(Process& process, const RunSettings& settings, const Communicator& comm) {
  const Mesh& mesh = process.mesh();
  std::vector<std::string> lines;
  lines.push_back(fmt::format("{} {} on {} rank{}: case '{}'", settings.program, MALLEUS_VERSION, comm.size(),
                              comm.size() == 1 ? "" : "s", settings.case_name));
  lines.push_back(fmt::format("mesh: {} nodes, {} {}, {} region{}", mesh.total_nodes(), mesh.total_elements,
                              mesh.dim == 3 ? "tetrahedra" : "triangles", mesh.region_names.size(),
                              mesh.region_names.size() == 1 ? "" : "s"));
  lines.push_back("each increment runs:");
  int number = 0;
  for (const Component* component : process.components()) {
    lines.push_back(fmt::format("  {}. {:<14} {}", ++number, component->name(), component->purpose()));
  }
  lines.push_back("left out:");
  for (const LeftOut& left : process.left_out()) lines.push_back(fmt::format("  {} ({})", left.physics, left.reason));
  const std::vector<std::string> suggestions = process.suggestions();
  if (!suggestions.empty()) lines.emplace_back("could be left out (docs/simplifications.md):");
  for (const std::string& suggestion : suggestions) lines.push_back("  " + suggestion);
  lines.push_back(fmt::format("accuracy (level {}):", settings.level));
  for (const std::string& setting : process.accuracy_settings()) lines.push_back("  " + setting);
  const Forecast forecast = process.forecast();
  lines.push_back(fmt::format("forecast: {} increments, {} wall time, {:.0f} MiB over all ranks", forecast.increments,
                              duration(forecast.wall_s), forecast.memory_bytes / 1048576));
  return lines;
}

}  // namespace

std::string duration(Real seconds) {
  if (!std::isfinite(seconds)) return "-";
  const auto whole = static_cast<GlobalId>(std::llround(std::ceil(seconds)));
  return fmt::format("{:02}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

void print_plan(Process& process, const RunSettings& settings, const Communicator& comm) {
  if (!settings.check_only) return;
  for (const std::string& line : plan_lines(process, settings, comm)) log::info("{}", line);
}

void print_heading(Process& process, const RunSettings& settings, const Communicator& comm) {
  for (const std::string& line : plan_lines(process, settings, comm)) log::info("{}", line);
}

void print_timings(const Communicator& comm, const std::vector<ComponentTime>& rows, Real total_wall_s) {
  log::info("{:<16}{:>8}{:>12}{:>12}{:>8}", "component", "calls", "mean s", "max s", "%");
  const Real total = comm.max(total_wall_s);
  Real named = 0;
  for (const ComponentTime& row : rows) {
    const Real mean = comm.sum(row.wall_s) / comm.size();
    const Real largest = comm.max(row.wall_s);
    named += mean;
    log::info("{:<16}{:>8}{:>12.3f}{:>12.3f}{:>8.1f}", row.name, row.calls, mean, largest, 100 * mean / total);
  }
  log::info("{:<16}{:>8}{:>12.3f}{:>12}{:>8.1f}", "other", "", total - named, "", 100 * (total - named) / total);
}

nlohmann::json summary(const Communicator& comm, Process& process, const RunSettings& settings,
                       const std::vector<ComponentTime>& rows) {
  const Mesh& mesh = process.mesh();
  nlohmann::json summary;
  summary["program"] = settings.program;
  summary["version"] = MALLEUS_VERSION;
  summary["ranks"] = comm.size();
  summary["nodes"] = mesh.total_nodes();
  summary["elements"] = mesh.total_elements;
  summary["peak_memory_bytes"] = comm.sum(peak_memory_bytes());
  summary["peak_memory_bytes_per_rank"] = comm.max(peak_memory_bytes());
  for (const ComponentTime& row : rows) {
    summary["components"][row.name] = {
        {"calls", row.calls},
        {"wall_s",
         {{"min", comm.min(row.wall_s)}, {"mean", comm.sum(row.wall_s) / comm.size()}, {"max", comm.max(row.wall_s)}}}};
  }
  const LinearTotals linear = process.linear_totals();
  summary["processor_s"] = comm.sum(processor_seconds());
  summary["linear"] = {{"solves", linear.solves},
                       {"iterations", linear.iterations},
                       {"failures", linear.failures},
                       {"assembly_s", comm.max(linear.assembly_s)},
                       {"setup_s", comm.max(linear.setup_s)},
                       {"solve_s", comm.max(linear.solve_s)}};
  summary["accuracy"] = process.accuracy();
  summary["accuracy"]["level"] = settings.level;
  summary["warnings"] = log::warnings();
  return summary;
}

nlohmann::json forecast_json(const Forecast& forecast, GlobalId after_increment, const Forecast& taken) {
  const auto ratio = [](Real taken_value, Real expected) {
    return expected > 0 ? nlohmann::json(taken_value / expected) : nullptr;
  };
  return {{"after_increment", after_increment},
          {"wall_s", forecast.wall_s},
          {"memory_bytes", forecast.memory_bytes},
          {"increments", forecast.increments},
          {"taken_over_expected",
           {{"increments", ratio(static_cast<Real>(taken.increments), static_cast<Real>(forecast.increments))},
            {"wall_s", ratio(taken.wall_s, forecast.wall_s)},
            {"memory_bytes", ratio(taken.memory_bytes, forecast.memory_bytes)}}}};
}

}  // namespace malleus::report
