#include "engine/engine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.hpp"
#include "base/log.hpp"
#include "engine/increments.hpp"
#include "engine/petsc_options.hpp"
#include "engine/report.hpp"
#include "engine/resources.hpp"
#include "parallel/agreement.hpp"
#include "parallel/fault.hpp"
#include "partition/balance.hpp"
#include "storage/atomic_file.hpp"

namespace malleus {
namespace {

constexpr GlobalId most_nodes_of_trials = 100000;  ///< a rank: larger meshes take more than seconds to make coarser
// Measured: processor time of writing fields, a rank and a node, and of a checkpoint, a rank.
constexpr Real output_s = 4e-3;
constexpr Real output_s_per_node = 2e-6;
constexpr Real checkpoint_s = 15e-3;
constexpr Real increments_bytes =
    8e6;  ///< a rank: of outputs, checkpoints and estimates, which steady scenes do without
constexpr Real growth_after_cut = 1.5;  ///< of the step from one increment to the next
/// Times the last increment and the longest checkpoint, kept free before the wall time ends.
constexpr Real wall_time_margin = 1.3;
constexpr Real first_checkpoint_in_outputs = 2;  ///< time of a checkpoint before there was one, in outputs of fields

/// Of solvers and their libraries, beyond what mesh and fields take (measured).
Real solver_bytes(int dim, Real nodes, int ranks) {
  return dim == 3 ? 6e6 * ranks + 3e3 * nodes : 14e6 * ranks + 1e3 * nodes;
}

/// Equal shares of a state that was read on another number of ranks than wrote it.
void balance_saved(const Communicator& comm, SavedState& saved) {
  FieldStore store;
  for (auto& [spec, values] : saved.fields) store.declare(saved.mesh, spec).assign(std::move(values));
  balance_along_curve(comm, saved.mesh, store);
  saved.fields.clear();
  for (const Field* field : store.all()) {
    saved.fields.emplace_back(field->spec(), std::vector<Real>(field->values().begin(), field->values().end()));
  }
}

std::vector<std::string> engine_columns() {
  return {"increment", "time_s", "dt_s", "nodes", "elements", "ranks", "volume_m3", "linear_iterations", "wall_s"};
}

}  // namespace

Engine::Engine(const Communicator& comm, Process& process, RunSettings settings, ProcessFactory on_mesh)
    : comm_(comm),
      process_(process),
      settings_(std::move(settings)),
      results_(comm, settings_.directory, settings_.case_name, settings_.precision),
      checkpoints_(comm, settings_.directory),
      space_estimate_(comm, std::move(on_mesh)),
      started_at_(wall_clock()) {}

template <class Work>
auto Engine::timed(const std::string& name, Work work) {
  struct Stopwatch {
    Timing& timing;
    Real began = wall_clock();
    ~Stopwatch() {
      ++timing.calls;
      timing.wall_s += wall_clock() - began;
    }
  } stopwatch{timing(name)};
  pass_fault_point(name);
  return work();
}

Engine::Timing& Engine::timing(const std::string& name) {
  const auto found = std::find_if(timings_.begin(), timings_.end(), [&](const Timing& t) { return t.name == name; });
  if (found != timings_.end()) return *found;
  return timings_.emplace_back(Timing{name, 0, 0});
}

Real Engine::wall_s() const {
  return wall_of_earlier_legs_ + wall_clock() - started_at_;
}

int Engine::run() {
  timings_.reserve(64);  // references to entries stay valid
  check_field_order();
  print_plan();
  if (settings_.check_only) {
    print_outlook();
    return exit_code::done;
  }
  open_outputs();
  if (settings_.increments && *settings_.increments == 0) return solve_once();
  return run_increments();
}

void Engine::check_field_order() {
  std::set<std::string> known;
  for (const Component* component : process_.components()) {
    for (const std::string& name : component->uses().starts) known.insert(name);
  }
  for (const Component* component : process_.components()) {
    const FieldUse use = component->uses();
    for (const std::string& name : use.reads) {
      const std::string message =
          fmt::format("component '{}' reads '{}', which no earlier one writes", component->name(), name);
      check(known.contains(name), message.c_str());
    }
    known.insert(use.writes.begin(), use.writes.end());
  }
}

void Engine::print_plan() {
  report::print_plan(process_, settings_, comm_);
}

/// What a rehearsal on coarser meshes tells of time, memory and error of the run.
void Engine::print_outlook() {
  if (process_.mesh().total_nodes() > most_nodes_of_trials * comm_.size()) return;
  const RunPlan plan = {settings_.step, settings_.end, settings_.increments};
  const auto memory = static_cast<Real>(comm_.sum(peak_memory_bytes()));
  const Real spent = comm_.sum(processor_seconds());
  const auto outlook = space_estimate_.look_ahead(process_, plan, seconds_of_rehearsal);
  if (!outlook) return;
  const auto nodes = static_cast<Real>(process_.mesh().total_nodes());
  const Real outputs = plan.is_steady() ? 1 : outlook->increments / static_cast<Real>(settings_.output_every) + 2;
  const Real total = spent + outlook->total_s(estimates_of_run(process_, plan)) +
                     outputs * (output_s * comm_.size() + output_s_per_node * nodes) +
                     (plan.is_steady() ? 0 : checkpoint_s) * comm_.size();
  const Real bytes = memory + (outlook->solves ? solver_bytes(process_.mesh().dim, nodes, comm_.size()) : 0) +
                     (plan.is_steady() ? 0 : increments_bytes * comm_.size());
  log::info("rehearsed: {} increments of {:.3g} s, {:.3g} s processor time in all, {} on {} rank{}; {:.0f} MiB",
            outlook->increments, outlook->increment_s, total, report::duration(total / comm_.size()), comm_.size(),
            comm_.size() == 1 ? "" : "s", bytes / 1048576);
  const std::string of_space = outlook->error > 0 ? fmt::format("{:.2g} %", 100 * outlook->error) : "unknown";
  log::info("expected error {:.2g} %: of space {}, of other sources {:.2g} %",
            100 * std::hypot(outlook->error, outlook->other_error), of_space, 100 * outlook->other_error);
}

void Engine::open_outputs() {
  on_root(comm_, [&] { make_directories(settings_.directory); });
  if (settings_.restart && try_restart()) return;
  if (settings_.restart) log::info("no checkpoint under {}: starting anew", settings_.directory.string());
  start_anew();
}

void Engine::start_anew() {
  on_root(comm_, [&] {
    log::open_file(settings_.directory / "run.log", false);
    std::error_code ignored;
    for (const char* name : {"summary.json", "stop"}) std::filesystem::remove(settings_.directory / name, ignored);
    write_file_atomically(settings_.directory / "case.resolved.ini", settings_.resolved_case);
  });
  report::print_heading(process_, settings_, comm_);
  if (const Forecast forecast = process_.forecast(); forecast.memory_bytes > settings_.memory_limit_bytes) {
    log::warning("[limits] memory: the forecast is {:.0f} MiB over all ranks, {:.0f} MiB are allowed",
                 forecast.memory_bytes / 1048576, settings_.memory_limit_bytes / 1048576);
  }
  checkpoints_.remove_all();
  results_.start_anew();
  std::vector<std::string> columns = engine_columns();
  for (std::string& name : process_.history_columns()) columns.push_back(std::move(name));
  history_ = History::anew(comm_, settings_.directory / "history.csv", columns);
  for (Component* component : process_.components()) {
    timed(component->name(), [&] { component->start(); });
  }
  if (Probes* probes = process_.probes()) probes->start_anew(settings_.directory, process_.fields());
}

bool Engine::try_restart() {
  std::optional<SavedState> saved = checkpoints_.read_newest();
  if (!saved) return false;
  if (saved->is_dealt_anew) balance_saved(comm_, *saved);
  try {
    restore(std::move(*saved));
  } catch (const nlohmann::json::exception& error) {  // the state is the same on all ranks
    throw InputError(fmt::format("--restart: the state in {} is not of this case, or of another version ({})",
                                 (settings_.directory / "checkpoints").string(), error.what()));
  }
  std::vector<std::string> columns = engine_columns();
  for (std::string& name : process_.history_columns()) columns.push_back(std::move(name));
  history_ = History::resumed(comm_, settings_.directory / "history.csv", columns, last_.number);
  on_root(comm_, [&] {
    log::open_file(settings_.directory / "run.log", true);
    write_file_atomically(settings_.directory / "case.resolved.ini", settings_.resolved_case);
  });
  results_.resume_after(last_.number);
  if (Probes* probes = process_.probes()) probes->resume(settings_.directory, process_.fields(), last_.time);
  log::info("restarted after increment {} at {:.6g} s", last_.number, last_.time);
  return true;
}

void Engine::restore(SavedState&& saved) {
  const nlohmann::json& state = saved.state.at("engine");
  if (const std::string program = state.at("program"); program != settings_.program) {
    throw InputError(fmt::format("--restart: the state in {} is of {}, not of {}",
                                 (settings_.directory / "checkpoints").string(), program, settings_.program));
  }
  last_ = {state.at("increment"), state.at("time"), state.at("dt")};
  next_dt_limit_ = state.at("dt_limit").is_null() ? std::numeric_limits<Real>::infinity() : Real(state.at("dt_limit"));
  wall_of_earlier_legs_ = state.at("wall_s");
  longest_checkpoint_s_ = state.at("longest_checkpoint_s");
  first_increment_ = last_.number;
  last_checkpoint_ = last_.number;
  last_checkpoint_wall_ = wall_s();
  last_output_ = state.at("last_output");
  space_estimate_.restore(state.at("space_estimate"));
  is_estimated_halfway_ = state.at("is_estimated_halfway");
  run_forecast_.restore(state.at("forecast"));
  if (Probes* probes = process_.probes()) probes->set_places(state.at("probes").get<std::vector<std::vector<Real>>>());
  process_.restore(std::move(saved.mesh), std::move(saved.fields), saved.state.at("process"));
  if (!saved.is_dealt_anew) process_.restore_local(saved.local);
}

int Engine::solve_once() {
  for (Component* component : process_.components()) {
    const Outcome outcome = timed(component->name(), [&] { return component->solve_once(); });
    if (outcome.kind == Outcome::Kind::done) continue;
    end_reason_ = component->name() + ": " + outcome.why;
    finish("failed", exit_code::numerics);
    return exit_code::numerics;
  }
  if (space_estimate_.is_asked_for()) {
    timed("estimate", [&] {
      space_estimate_.prepare(process_);
      space_estimate_.compare(process_, std::nullopt);
    });
  }
  record(last_);
  finish("done", exit_code::done);
  return exit_code::done;
}

int Engine::run_increments() {
  if (last_output_ < 0) write_fields(last_.number);
  while (!is_over()) {
    if (const std::string reason = reason_to_stop(); !reason.empty()) {
      end_reason_ = reason;
      write_checkpoint_if_new();
      finish("stopped", exit_code::checkpointed);
      return exit_code::checkpointed;
    }
    const Real began = wall_clock();
    const auto failure = make_increment();
    last_increment_s_ = wall_clock() - began;
    if (failure) {
      end_reason_ = *failure;
      write_checkpoint_if_new();
      finish("failed", exit_code::numerics);
      return exit_code::numerics;
    }
    if (checkpoint_is_due()) write_checkpoint();
  }
  write_checkpoint_if_new();  // --restart goes on from it, as may another case
  finish("done", exit_code::done);
  return exit_code::done;
}

bool Engine::is_over() {
  if (const auto why = process_.finished()) end_reason_ = *why;
  if (end_reason_.empty() && settings_.increments && last_.number >= *settings_.increments) end_reason_ = "increments";
  if (end_reason_.empty() && last_.time >= settings_.end * (1 - 1e-12)) end_reason_ = "end time";
  if (end_reason_.empty() && settings_.more_increments &&
      last_.number - first_increment_ >= *settings_.more_increments) {
    end_reason_ = "--steps";
  }
  return !end_reason_.empty();
}

/// The step is what the case and the physics allow, shortened so that the end is met in equal steps.
Increment Engine::next_increment() {
  const Real allowed = std::min({settings_.step, process_.largest_step(), next_dt_limit_});
  const Real dt = planned_step(allowed, last_.time, settings_.end);
  if (!std::isfinite(dt)) throw InputError("[time]: nothing limits the step: give [time] step or end");
  if (!(dt > 0)) throw Defect("the next step is not positive", std::source_location::current());
  return {last_.number + 1, last_.time + dt, dt};
}

/// Whether the coming increment will be repeated on coarser meshes: the first, and the first one past the middle.
bool Engine::begin_estimate() {
  if (!space_estimate_.is_asked_for()) return false;
  const bool is_halfway = !is_estimated_halfway_ && process_.solves_again() && progress() >= 0.5;
  if (last_.number > 0 && !is_halfway) return false;
  is_estimated_halfway_ = is_halfway;
  if (is_halfway) process_.solve_all_next();
  timed("estimate", [&] { space_estimate_.prepare(process_); });
  return true;
}

/// One increment, tried with smaller steps where components ask for it. The reason of a final failure.
std::optional<std::string> Engine::make_increment() {
  const bool is_compared = begin_estimate();
  Increment increment = next_increment();
  for (int cut = 0;; ++cut) {
    const Outcome outcome = try_components(process_, [&](Component& component) {
      return timed(component.name(), [&] { return component.advance(increment); });
    });
    if (outcome.kind == Outcome::Kind::done) {
      next_dt_limit_ = cut > 0 || std::isfinite(next_dt_limit_) ? increment.dt * growth_after_cut
                                                                : std::numeric_limits<Real>::infinity();
      last_ = increment;
      if (is_compared) timed("estimate", [&] { space_estimate_.compare(process_, increment); });
      record(increment);
      foresee();
      return std::nullopt;
    }
    if (outcome.kind == Outcome::Kind::failed || cut == most_cuts) return outcome.why;
    increment = shortened(increment, last_.time, outcome);
    log::info("increment {}: {}; the step is cut to {:.3g} s", increment.number, outcome.why, increment.dt);
  }
}

void Engine::record(const Increment& increment) {
  const Mesh& mesh = process_.mesh();
  const GlobalId iterations = process_.linear_totals().iterations;
  std::vector<HistoryCell> row = {static_cast<Real>(increment.number),
                                  increment.time,
                                  increment.dt,
                                  static_cast<Real>(mesh.total_nodes()),
                                  static_cast<Real>(mesh.total_elements),
                                  static_cast<Real>(comm_.size()),
                                  process_.volume(),
                                  static_cast<Real>(iterations - recorded_iterations_),
                                  std::round(wall_s() * 1e3) / 1e3};
  recorded_iterations_ = iterations;
  for (const HistoryCell& cell : process_.history_row()) row.push_back(cell);
  timed("history", [&] { history_->append(row); });
  if (Probes* probes = process_.probes()) {
    timed("probes", [&] {
      process_.refresh_outputs();
      probes->record(increment.time, process_.mesh(), process_.fields());
    });
  }
  print_increment(increment);
  if (increment.number % settings_.output_every == 0) write_fields(increment.number);
}

Stand Engine::stand() const {
  const Real by_time = std::isfinite(settings_.end) ? last_.time / settings_.end : 0;
  const Real by_count =
      settings_.increments ? Real(last_.number) / Real(std::max<GlobalId>(*settings_.increments, 1)) : 0;
  return {last_.number, wall_s(), {by_time, by_count, process_.progress()}};
}

/// Share of the run that is done, 0..1, as far as it can be told.
Real Engine::progress() const {
  const std::array<Real, 3> parts = stand().progress;
  return std::clamp(*std::ranges::max_element(parts), 0.0, 1.0);
}

void Engine::print_increment(const Increment& increment) {
  const auto rest = run_forecast_.rest(stand());
  log::info("{:6} | t {:.5g} s | dt {:.3g} s | {} | {:.1f} s | {:.0f} % | left {}", increment.number, increment.time,
            increment.dt, process_.increment_note(), wall_s(), 100 * progress(),
            rest ? report::duration(rest->wall_s) : "-");
}

void Engine::write_fields(GlobalId increment) {
  timed("output", [&] {
    process_.refresh_outputs();
    const std::vector<std::string> names =
        settings_.output_fields.empty() ? process_.output_fields() : settings_.output_fields;
    std::vector<const Field*> fields;
    for (const std::string& name : names) {
      if (process_.fields().has(name)) fields.push_back(&process_.fields()[name]);
    }
    results_.write(increment, last_.time, process_.mesh(), fields);
  });
  last_output_ = increment;
}

bool Engine::checkpoint_is_due() const {
  if (settings_.checkpoint_every_increments &&
      last_.number - std::max<GlobalId>(last_checkpoint_, 0) >= *settings_.checkpoint_every_increments) {
    return true;
  }
  const bool by_time = wall_s() - last_checkpoint_wall_ >= settings_.checkpoint_every_wall_s;
  return comm_.broadcast(by_time);
}

void Engine::write_checkpoint() {
  const Real began = wall_clock();
  timed("checkpoint", [&] {
    history_->flush_to_disk();
    nlohmann::json state;
    state["engine"] = {{"program", settings_.program},
                       {"increment", last_.number},
                       {"time", last_.time},
                       {"dt", last_.dt},
                       {"dt_limit", std::isfinite(next_dt_limit_) ? nlohmann::json(next_dt_limit_) : nlohmann::json()},
                       {"wall_s", wall_s()},
                       {"longest_checkpoint_s", longest_checkpoint_s_},
                       {"last_output", last_output_},
                       {"space_estimate", space_estimate_.save()},
                       {"is_estimated_halfway", is_estimated_halfway_},
                       {"forecast", run_forecast_.save()}};
    if (const Probes* probes = process_.probes()) state["engine"]["probes"] = probes->places();
    state["process"] = process_.save_state();
    checkpoints_.write(last_.number, process_.mesh(), process_.fields(), state, process_.save_local());
  });
  last_checkpoint_ = last_.number;
  last_checkpoint_wall_ = wall_s();
  longest_checkpoint_s_ = std::max(longest_checkpoint_s_, wall_clock() - began);
}

void Engine::write_checkpoint_if_new() {
  if (last_checkpoint_ != last_.number) write_checkpoint();
}

std::string Engine::reason_to_stop() {
  const std::string reason = stop_.asked(comm_, settings_.directory);
  return reason.empty() ? reason_in_limits() : reason;
}

/// The limit that the next increment and the checkpoint after it would go beyond; empty where there is none.
std::string Engine::reason_in_limits() {
  Real checkpoint_s = longest_checkpoint_s_;
  if (const Timing& output = timing("output"); checkpoint_s == 0 && output.calls > 0) {
    checkpoint_s = first_checkpoint_in_outputs * output.wall_s / static_cast<Real>(output.calls);
  }
  const Real needed = wall_since_program_start() + wall_time_margin * (last_increment_s_ + checkpoint_s);
  if (comm_.broadcast(needed > settings_.wall_time_limit_s)) return "[limits] wall_time";
  if (!std::isfinite(settings_.memory_limit_bytes)) return "";
  const Real mib = 1.0 / 1048576;
  const auto peak = static_cast<Real>(comm_.sum(peak_memory_bytes()));
  if (last_.number == first_increment_ || peak <= settings_.memory_limit_bytes) return "";
  return fmt::format(
      "[limits] memory: increment {} took {:.0f} MiB over all ranks, {:.0f} MiB are allowed; give at "
      "least {:.0f} MiB",
      last_.number, peak * mib, settings_.memory_limit_bytes * mib, std::ceil(1.1 * peak * mib));
}

ErrorBudget Engine::error_budget() {
  ErrorBudget budget = process_.error_budget();
  const std::vector<Component*> components = process_.components();
  const bool remeshes = std::any_of(components.begin(), components.end(),
                                    [](const Component* component) { return component->name() == "remeshing"; });
  if (const auto share = space_estimate_.share(remeshes)) {
    budget.add(*share);
  } else if (space_estimate_.is_asked_for() && !process_.results().empty()) {
    budget.add_unknown("space", "no coarser mesh could be made on which the scene can be solved");
  }
  return budget;
}

void Engine::finish(const std::string& status, int code) {
  for (const std::string& option : unused_petsc_options()) {
    log::warning("command line: nothing asked for the PETSc option {}", option);
  }
  if (last_output_ != last_.number || code == exit_code::numerics) write_fields(last_.number);
  const ErrorBudget budget = error_budget();
  write_summary(status, code, budget);
  print_timings();
  print_checkpoint_cost();
  for (const std::string& line : process_.closing_lines()) log::info("{}", line);
  for (const std::string& line : budget.lines()) log::info("{}", line);
  if (code == exit_code::done && last_.number > 0) print_taken();
  log::info("{} ({}): results in {}", status, end_reason_.empty() ? "solved" : end_reason_,
            settings_.directory.string());
  if (code == exit_code::numerics && comm_.is_root()) {
    fmt::print(stderr, "error: {}\nThe last good state is that of increment {}, in {}\n", end_reason_, last_.number,
               (settings_.directory / (settings_.case_name + ".xdmf")).string());
  }
}

/// What the rest of the run will take, said once, as soon as its first increments tell.
void Engine::foresee() {
  const bool is_estimate_left = space_estimate_.is_asked_for() && process_.solves_again() && !is_estimated_halfway_;
  const Real estimate_s = is_estimate_left ? timing("estimate").wall_s : 0;
  if (!run_forecast_.see(comm_, stand(), estimate_s)) return;
  const Forecast& forecast = *run_forecast_.made();
  log::info("forecast from the increments so far: {} increments, {} wall time, {:.0f} MiB over all ranks",
            forecast.increments, report::duration(forecast.wall_s), forecast.memory_bytes / 1048576);
}

/// The run's own forecast and the increments it was made after; where it made none, that of the plan and 0.
std::pair<Forecast, GlobalId> Engine::best_forecast() const {
  if (const auto& made = run_forecast_.made()) return {*made, run_forecast_.made_after()};
  return {process_.forecast(), 0};
}

void Engine::print_taken() const {
  const auto [forecast, after] = best_forecast();
  const std::string when = after > 0 ? fmt::format("after increment {}", after) : "before the run";
  log::info("took {} increments, {:.1f} s and {:.0f} MiB; the forecast {} was {}, {:.1f} s and {:.0f} MiB",
            last_.number, wall_s(), static_cast<Real>(comm_.sum(peak_memory_bytes())) / 1048576, when,
            forecast.increments, forecast.wall_s, forecast.memory_bytes / 1048576);
}

void Engine::print_timings() {
  std::vector<report::ComponentTime> rows;
  for (const Timing& t : timings_) rows.push_back({t.name, t.calls, t.wall_s});
  report::print_timings(comm_, rows, wall_clock() - started_at_);
}

void Engine::print_checkpoint_cost() {
  const Timing& checkpoint = timing("checkpoint");
  if (checkpoint.calls == 0) return;
  log::info("checkpoints: {} in {:.2f} s, {:.1f} % of the run", checkpoint.calls, checkpoint.wall_s,
            100 * checkpoint.wall_s / (wall_clock() - started_at_));
}

void Engine::write_summary(const std::string& status, int code, const ErrorBudget& budget) {
  std::vector<report::ComponentTime> rows;
  for (const Timing& t : timings_) rows.push_back({t.name, t.calls, t.wall_s});
  nlohmann::json summary = report::summary(comm_, process_, settings_, rows);
  if (!budget.empty()) {
    summary["accuracy"]["estimated_error"] = budget.total();
    summary["accuracy"]["error_budget"] = budget.json();
    if (const auto unknown = budget.unknown(); !unknown.empty()) summary["accuracy"]["unknown_errors"] = unknown;
  }
  summary["status"] = status;
  summary["exit_code"] = code;
  summary["reason"] = end_reason_;
  summary["increments"] = last_.number;
  summary["wall_s"] = wall_s();
  const auto [forecast, after] = best_forecast();
  summary["forecast"] =
      report::forecast_json(forecast, after, {wall_s(), summary["peak_memory_bytes"].get<Real>(), last_.number});
  nlohmann::json final_row = nlohmann::json::object();
  for (std::size_t i = 0; i < history_->last_row().size(); ++i) {
    const HistoryCell& cell = history_->last_row()[i];
    final_row[history_->columns()[i]] = cell ? nlohmann::json(*cell) : nlohmann::json();
  }
  summary["final"] = final_row;
  on_root(comm_, [&] { write_file_atomically(settings_.directory / "summary.json", summary.dump(2) + "\n"); });
}

}  // namespace malleus
