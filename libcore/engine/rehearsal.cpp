#include "engine/rehearsal.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/log.hpp"
#include "engine/increments.hpp"
#include "engine/resources.hpp"

namespace malleus {
namespace {

bool is_over(Process& process, const RunPlan& plan, const Increment& last) {
  if (process.finished()) return true;
  if (plan.increments && last.number >= *plan.increments) return true;
  return last.time >= plan.end * (1 - 1e-12);
}

Real progress_of(Process& process, const RunPlan& plan, const Increment& last) {
  Real progress = process.progress();
  if (std::isfinite(plan.end)) progress = std::max(progress, last.time / plan.end);
  if (plan.increments) {
    progress = std::max(progress, static_cast<Real>(last.number) / static_cast<Real>(*plan.increments));
  }
  return std::clamp(progress, 0.0, 1.0);
}

std::optional<Increment> next_increment(Process& process, const RunPlan& plan, const Increment& last) {
  const Real dt = planned_step(std::min(plan.step, process.largest_step()), last.time, plan.end);
  if (!std::isfinite(dt) || !(dt > 0)) return std::nullopt;
  return Increment{last.number + 1, last.time + dt, dt};
}

/// A step tried with less and less where components ask for it; none where it fails. Collective.
std::optional<Increment> advance_silently(Process& process, Increment increment) {
  const Real start = increment.start();
  for (int cut = 0; cut <= most_cuts; ++cut) {
    const Outcome outcome = try_components(process, [&](Component& component) { return component.advance(increment); });
    if (outcome.kind == Outcome::Kind::done) return increment;
    if (outcome.kind == Outcome::Kind::failed) return std::nullopt;
    increment = shortened(increment, start, outcome);
  }
  return std::nullopt;
}

std::optional<Rehearsal> rehearse_steady(const Communicator& comm, Process& process) {
  const Real began = comm.sum(processor_seconds());
  for (Component* component : process.components()) {
    if (component->solve_once().kind != Outcome::Kind::done) return std::nullopt;
  }
  Rehearsal seen;
  seen.first_s = comm.sum(processor_seconds()) - began;
  seen.results = process.results();
  return seen;
}

std::optional<Rehearsal> rehearse_increments(const Communicator& comm, Process& process, const RunPlan& plan,
                                             Real most_s) {
  const Real began = comm.sum(processor_seconds());
  for (Component* component : process.components()) component->start();
  Rehearsal seen;
  Increment last;
  Real spent = 0;
  while (!is_over(process, plan, last) && (last.number == 0 || spent < most_s)) {
    const auto next = next_increment(process, plan, last);
    const auto done = next ? advance_silently(process, *next) : std::nullopt;
    if (!done) break;
    last = *done;
    process.history_row();
    spent = comm.sum(processor_seconds()) - began;
    if (last.number > 1) continue;
    seen.first_s = spent;
    seen.results = process.results();
  }
  if (last.number == 0) return std::nullopt;
  const auto done = static_cast<Real>(last.number);
  const bool is_done = is_over(process, plan, last);
  const Real progress = progress_of(process, plan, last);
  seen.done = done;
  seen.increments = is_done || !(progress > 0) ? done : std::max(done, std::round(done / progress));
  seen.later_s = last.number > 1 ? (spent - seen.first_s) / (done - 1) : seen.first_s;
  return seen;
}

/// a + b nodes through the times of two meshes, both parts not negative; of one mesh all of it goes with the nodes.
Real time_on(const std::vector<Rehearsal>& seen, Real Rehearsal::*time, Real nodes) {
  const Rehearsal& fine = seen[0];
  Real slope = fine.*time / fine.nodes;
  if (seen.size() > 1 && fine.nodes > seen[1].nodes) {
    slope = std::clamp((fine.*time - seen[1].*time) / (fine.nodes - seen[1].nodes), 0.0, slope);
  }
  return fine.*time + slope * (nodes - fine.nodes);
}

}  // namespace

std::optional<Rehearsal> rehearse(const Communicator& comm, Process& process, const RunPlan& plan, Real most_s) {
  const log::Silence silence;
  try {
    const auto nodes = static_cast<Real>(process.mesh().total_nodes());
    std::optional<Rehearsal> seen =
        plan.is_steady() ? rehearse_steady(comm, process) : rehearse_increments(comm, process, plan, most_s);
    if (!seen) return std::nullopt;
    seen->nodes = nodes;
    seen->solves = process.linear_totals().solves > 0;
    seen->other_error = process.error_budget().total();
    return seen;
  } catch (const InputError&) {  // a scene that cannot be set up on a mesh that coarse
    return std::nullopt;
  } catch (const NumericsError&) {
    return std::nullopt;
  }
}

Rehearsal extrapolated_run(const std::vector<Rehearsal>& seen, Real nodes, int dim, bool steps_follow_sizes) {
  check(!seen.empty(), "a run is extrapolated from one rehearsal or more");
  Rehearsal run = seen[0];
  run.nodes = nodes;
  run.first_s = time_on(seen, &Rehearsal::first_s, nodes);
  run.later_s = time_on(seen, &Rehearsal::later_s, nodes);
  if (steps_follow_sizes) {
    const Real ratio = std::pow(nodes / seen[0].nodes, 1.0 / dim);
    run.increments = std::max(1.0, std::round(seen[0].increments * ratio));
    run.other_error = seen[0].other_error / ratio;
  }
  return run;
}

}  // namespace malleus
