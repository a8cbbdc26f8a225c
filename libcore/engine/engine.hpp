#pragma once

/// The loop that every simulation shares: increments, retries, outputs, checkpoints, stops, and the report.

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/history.hpp"
#include "engine/process.hpp"
#include "engine/run_forecast.hpp"
#include "engine/space_estimate.hpp"
#include "engine/stop_request.hpp"
#include "parallel/communicator.hpp"
#include "storage/checkpoint.hpp"
#include "storage/result_writer.hpp"

namespace malleus {

/// How long, how often, where: from the case file and the command line. Times in s.
struct RunSettings {
  std::string program;    ///< "forge"
  std::string case_name;  ///< names the .xdmf
  std::filesystem::path directory;
  std::string level;                                  ///< accuracy level, for the summary
  Real end = std::numeric_limits<Real>::infinity();   ///< [time] end
  Real step = std::numeric_limits<Real>::infinity();  ///< [time] step, the largest
  std::optional<GlobalId> increments;                 ///< [time] increments
  GlobalId output_every = 1;                          ///< increments
  ResultWriter::Precision precision = ResultWriter::Precision::float32;
  std::vector<std::string> output_fields;  ///< [output] fields; empty = the process' own list
  std::optional<GlobalId> checkpoint_every_increments;
  Real checkpoint_every_wall_s = std::numeric_limits<Real>::infinity();
  Real wall_time_limit_s = std::numeric_limits<Real>::infinity();   ///< [limits] wall_time
  Real memory_limit_bytes = std::numeric_limits<Real>::infinity();  ///< [limits] memory, over all ranks
  std::optional<GlobalId> more_increments;                          ///< --steps
  bool restart = false;
  bool check_only = false;
  std::string resolved_case;  ///< text of case.resolved.ini
};

/// Runs a process. Before the first increment it refuses (Defect) a component that reads a field which nothing gives.
class Engine {
 public:
  /// on_mesh: the scene anew on another mesh, for the estimate of the error of space; without it none is made.
  Engine(const Communicator& comm, Process& process, RunSettings settings, ProcessFactory on_mesh = {});

  /// The whole run. Returns the exit code: done, numerics or checkpointed. A storage failure is thrown. Collective.
  int run();

 private:
  struct Timing {
    std::string name;
    GlobalId calls = 0;
    Real wall_s = 0;
  };

  void print_plan();
  void print_outlook();
  void check_field_order();
  void open_outputs();
  bool try_restart();
  void restore(SavedState&& saved);
  void start_anew();
  int run_increments();
  int solve_once();
  bool is_over();
  Increment next_increment();
  std::optional<std::string> make_increment();
  bool begin_estimate();
  Stand stand() const;
  Real progress() const;
  ErrorBudget error_budget();
  void record(const Increment& increment);
  void print_increment(const Increment& increment);
  void write_fields(GlobalId increment);
  void write_checkpoint();
  void write_checkpoint_if_new();
  bool checkpoint_is_due() const;
  std::string reason_to_stop();
  std::string reason_in_limits();
  void finish(const std::string& status, int code);
  void write_summary(const std::string& status, int code, const ErrorBudget& budget);
  void print_timings();
  void print_checkpoint_cost();
  void foresee();
  std::pair<Forecast, GlobalId> best_forecast() const;
  void print_taken() const;
  Timing& timing(const std::string& name);
  template <class Work>
  auto timed(const std::string& name, Work work);
  Real wall_s() const;

  const Communicator& comm_;
  Process& process_;
  RunSettings settings_;
  StopRequest stop_;
  ResultWriter results_;
  CheckpointStore checkpoints_;
  SpaceEstimate space_estimate_;
  bool is_estimated_halfway_ = false;
  RunForecast run_forecast_;
  std::optional<History> history_;
  std::vector<Timing> timings_;
  Increment last_;                                              ///< the last increment done
  Real next_dt_limit_ = std::numeric_limits<Real>::infinity();  ///< after a cut step
  GlobalId first_increment_ = 0;                                ///< of this leg
  GlobalId last_output_ = -1;
  GlobalId recorded_iterations_ = 0;  ///< of the linear solver, up to the last row of the history
  GlobalId last_checkpoint_ = -1;     ///< increment of the newest checkpoint of this run; -1: none
  Real last_checkpoint_wall_ = 0;
  Real longest_checkpoint_s_ = 0;
  Real last_increment_s_ = 0;  ///< wall time that the last increment took
  Real started_at_ = 0;
  Real wall_of_earlier_legs_ = 0;
  std::string end_reason_;
};

}  // namespace malleus
