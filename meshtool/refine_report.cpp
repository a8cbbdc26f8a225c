#include "meshtool/refine_report.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "engine/resources.hpp"
#include "mesh/ordered_file.hpp"

namespace malleus::meshtool {
namespace {

nlohmann::json quality_json(const MetricFit& fit) {
  return {{"min", fit.quality_min}, {"mean", fit.quality_mean}, {"p01", fit.quality_p01}};
}

nlohmann::json rounds_json(const DistributedRemeshReport& report) {
  nlohmann::json rounds = nlohmann::json::array();
  for (const RemeshRound& round : report.rounds) {
    rounds.push_back({{"elements", round.elements},
                      {"largest_elements", round.largest_elements},
                      {"moved_elements", round.moved_elements},
                      {"sent_bytes", round.sent_bytes},
                      {"remesh_cpu_s", round.remesh_s}});
  }
  return rounds;
}

nlohmann::json to_json(const Communicator& comm, const DistributedRemeshReport& report,
                       const std::vector<RemeshPhase>& phases) {
  nlohmann::json wall = nlohmann::json::object();
  Real total = 0;
  for (const auto* list : {&phases, &report.phases}) {
    for (const RemeshPhase& phase : *list) {
      wall[phase.name] = phase.wall_s;
      total += phase.wall_s;
    }
  }
  wall["total"] = total;
  nlohmann::json processor = nlohmann::json::object();
  for (const RemeshPhase& phase : report.phases) processor[phase.name] = phase.processor_s;
  const GlobalId peak = comm.sum(peak_memory_bytes());
  return {
      {"ranks", comm.size()},
      {"nodes", report.nodes_after},
      {"elements", report.elements_after},
      {"nodes_before", report.nodes_before},
      {"elements_before", report.elements_before},
      {"wall_s", wall},
      {"processor_s", processor},
      {"peak_memory_bytes", peak},
      {"quality", quality_json(report.after)},
      {"quality_before", quality_json(report.before)},
      {"edges",
       {{"fraction", report.after.conforming}, {"min", report.after.edge_min}, {"max", report.after.edge_max}}},
      {"volume", {{"before", report.before.volume}, {"after", report.after.volume}}},
      {"inverted", report.after.inverted},
      {"interface_nodes", report.interface_nodes},
      {"operations",
       {{"splits", report.splits}, {"collapses", report.collapses}, {"swaps", report.swaps}, {"moves", report.moves}}},
      {"rounds", rounds_json(report)}};
}

}  // namespace

void report_refinement(const Communicator& comm, const RefineOptions& options, const DistributedRemeshReport& report,
                       const std::vector<RemeshPhase>& phases) {
  const nlohmann::json json = to_json(comm, report, phases);
  log::info("{}: {} nodes, {} elements (before: {}, {}) in {:.3g} s", options.output, report.nodes_after,
            report.elements_after, report.nodes_before, report.elements_before, json["wall_s"]["total"].get<Real>());
  log::info(
      "quality (1 regular, 0 flat): min {:.3g}, 1 % {:.3g}, mean {:.3g}; {:.1f} % of the edges within [0.71, 1.41]",
      report.after.quality_min, report.after.quality_p01, report.after.quality_mean, 100 * report.after.conforming);
  if (report.after.inverted > 0)
    log::warning("{} elements are inverted: no operation could turn them", report.after.inverted);
  if (options.report.empty()) return;
  OrderedFile file(comm, options.report);
  file.append_from_root(json.dump(2) + "\n");
  file.close();
}

}  // namespace malleus::meshtool
