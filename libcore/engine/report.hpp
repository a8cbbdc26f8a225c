#pragma once

/// The engine's texts: plan, timings, summary.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/engine.hpp"

namespace malleus::report {

struct ComponentTime {
  std::string name;
  GlobalId calls = 0;
  Real wall_s = 0;  ///< this rank's
};

std::string duration(Real seconds);  ///< "01:23:45"
/// Mesh counts, components in order, physics left out and why, accuracy settings, forecast. Collective.
void print_plan(Process& process, const RunSettings& settings, const Communicator& comm);
/// The plan once more for run.log, which opens after the plan was shown. Collective.
void print_heading(Process& process, const RunSettings& settings, const Communicator& comm);
/// Mean and largest time of each component over the ranks, and what is not in them. Collective.
void print_timings(const Communicator& comm, const std::vector<ComponentTime>& rows, Real total_wall_s);
/// What summary.json says of the run as a whole, without status and final row. Collective.
nlohmann::json summary(const Communicator& comm, Process& process, const RunSettings& settings,
                       const std::vector<ComponentTime>& rows);
/// `forecast` of summary.json: what was expected after an increment (0: before the run), and what was taken over it.
/// Local.
nlohmann::json forecast_json(const Forecast& forecast, GlobalId after_increment, const Forecast& taken);

}  // namespace malleus::report
