#include "partition/partition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <numeric>

#include "base/error.hpp"
#include "mesh/curve_partition.hpp"
#include "mesh/space_filling_curve.hpp"
#include "partition/bisect.hpp"
#include "partition/grow_bisect.hpp"
#include "partition/multilevel.hpp"
#include "partition/relabel.hpp"
#include "partition/scotch_start.hpp"
#include "partition/strip_migration.hpp"

namespace malleus {
namespace {

/// Above this imbalance of the present partition a new one is made as well, and the better of the two taken: flows
/// then move whole parts, and the borders that they leave are long.
constexpr Real start_anew_from = 0.5;
/// What a new one must gain over the repaired one, moves counted: differences below mean nothing, and moves cost more
/// than their bytes.
constexpr Real anew_gain = 0.005;
/// Flows leave longer borders than a start of its own kind does: they are refined more.
constexpr int repair_passes = 2;
constexpr int levelling_rounds = 16;
constexpr int levelling_patience = 5;  ///< rounds without a better partition after which it ends
/// Of the loads about the moved targets: two elements, within these bounds.
constexpr Real least_levelling_tolerance = 0.0015;
constexpr Real largest_levelling_tolerance = 0.004;
/// Mesh edges that are cut with a face between elements, measured on refined partitions of tetrahedral meshes.
constexpr Real mesh_edges_per_face = 2.5;

/// Wall time by phase; the largest over the ranks is asked for at the end.
class PhaseClock {
 public:
  void end(const std::string& phase) {
    const auto now = std::chrono::steady_clock::now();
    seconds_[phase] += std::chrono::duration<Real>(now - start_).count();
    start_ = now;
    const std::clock_t processor = std::clock();
    processor_[phase] += static_cast<Real>(processor - processor_start_) / CLOCKS_PER_SEC;
    processor_start_ = processor;
  }
  std::map<std::string, Real> largest(const Communicator& comm) const {
    std::map<std::string, Real> seconds;
    for (const auto& [phase, mine] : seconds_) seconds[phase] = comm.max(mine);
    return seconds;
  }
  /// Of this rank, in one phase.
  Real processor_seconds(const std::string& phase) const {
    const auto found = processor_.find(phase);
    return found == processor_.end() ? 0 : found->second;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::map<std::string, Real> seconds_;
  std::clock_t processor_start_ = std::clock();
  std::map<std::string, Real> processor_;
};

/// Stretches of the space-filling curve through the vertices, in proportion to the shares.
std::vector<int> curve_parts(const Communicator& comm, const WorkGraph& graph, std::span<const Real> shares) {
  const Box box = bounding_box(comm, graph.centres, graph.dim);
  std::vector<std::uint64_t> keys(graph.weights.size());
  std::vector<GlobalId> weights(graph.weights.size());
  for (std::size_t v = 0; v < keys.size(); ++v) {
    keys[v] = hilbert_key(graph.centres.data() + v * static_cast<std::size_t>(graph.dim), graph.dim, box);
    weights[v] = static_cast<GlobalId>(graph.weights[v]);
  }
  return curve_partition(comm, keys, weights, shares);
}

/// A partition on its way, with its name and cost.
struct Candidate {
  std::vector<int> parts;  ///< [owned vertex]
  std::string made_by;
  PartitionCost cost;
  Real moved = 0;
};

class Planner {
 public:
  Planner(const Communicator& comm, const Mesh& mesh, const WorkModel& model, const Architecture& architecture,
          const PartitionOptions& options)
      : comm_(comm),
        mesh_(mesh),
        model_(model),
        architecture_(architecture),
        options_(options),
        graph_(build_work_graph(comm, mesh, element_work(comm, mesh, model), model.couplings)) {
    clock_.end("graph");
    const Real total = comm.sum(std::accumulate(graph_.weights.begin(), graph_.weights.end(), Real{0}));
    for (const Real speed : architecture.speed) targets_.push_back(total * speed / architecture.total_speed());
  }

  PartitionPlan run(std::span<const int> from, bool has_start) {
    PartitionPlan plan;
    Candidate best;
    if (!has_start) {
      if (options_.method == Partitioner::refined) {
        best = anew();
      } else {
        best = along_curve();
        if (options_.method == Partitioner::strips) best = by_strips(best);
      }
      plan.before = best.cost;
    } else {
      const Candidate present = {{from.begin(), from.end()}, "as it was", cost_of(from), 0};
      plan.before = present.cost;
      if (options_.method == Partitioner::keep) best = present;
      if (options_.method == Partitioner::curve) best = along_curve();
      if (options_.method == Partitioner::strips) best = by_strips(present);
      if (options_.method == Partitioner::refined) best = repaired(present);
      best.moved = moved_work(from, best.parts);
      if (options_.method != Partitioner::curve && best.cost.cost >= present.cost.cost) best = present;
    }
    plan.parts = std::move(best.parts);
    plan.after = std::move(best.cost);
    plan.made_by = std::move(best.made_by);
    plan.moved = best.moved;
    if (has_start) plan.moved_elements = count_moved(from, plan.parts);
    plan.count = count_;
    plan.seconds = clock_.largest(comm_);
    plan.processor_seconds = comm_.max(clock_.processor_seconds("divide"));
    plan.graph_processor_seconds = comm_.max(clock_.processor_seconds("graph"));
    return plan;
  }

 private:
  PartitionCost cost_of(std::span<const int> parts) {
    clock_.end("divide");
    PartitionCost cost = partition_cost(comm_, mesh_, graph_, model_, architecture_, parts);
    clock_.end("evaluate");
    return cost;
  }

  Candidate along_curve() {
    Candidate candidate = {curve_parts(comm_, graph_, architecture_.speed), "curve", {}, 0};
    candidate.cost = cost_of(candidate.parts);
    return candidate;
  }

  Candidate by_strips(const Candidate& present) {
    StripOptions strips;
    strips.edge_cost = model_.communication * (1 + mesh_edges_per_face) / graph_.unit;
    StripReport report;
    Candidate candidate = {migrate_strips(comm_, graph_, architecture_, present.parts, strips, report), "", {}, 0};
    candidate.made_by = fmt::format("{} pairs of strips in {} iterations", report.pairs, report.iterations);
    candidate.cost = cost_of(candidate.parts);
    return candidate;
  }

  MultilevelSettings multilevel_settings() const {
    MultilevelSettings settings;
    settings.tolerance = options_.tolerance;
    return settings;
  }

  std::vector<int> refine(std::vector<int> parts) {
    MultilevelSettings settings = multilevel_settings();
    settings.passes = repair_passes;
    return refine_multilevel(comm_, graph_, architecture_, std::move(parts), targets_, settings, count_);
  }

  StartMaker start_maker(PartitionStart start) const {
    const std::vector<Real>& speeds = architecture_.speed;
    switch (start) {
      case PartitionStart::coordinate:
        return {[&](const auto& comm, const auto& graph) {
          return bisect(comm, graph, speeds, BisectionAxis::coordinate);
        }};
      case PartitionStart::inertial:
        return {
            [&](const auto& comm, const auto& graph) { return bisect(comm, graph, speeds, BisectionAxis::inertial); }};
      case PartitionStart::growth:
        return {[&](const auto& comm, const auto& graph) { return grow_bisect(comm, graph, speeds); }, true};
      default:
        return {[&](const auto& comm, const auto& graph) { return curve_parts(comm, graph, speeds); }};
    }
  }

  /// The chosen start; PT-Scotch's parts are never empty, and the curve stands for it where some must be.
  PartitionStart possible_start() const {
    const bool has_empty = architecture_.parts() > graph_.ownership.total();
    return options_.start == PartitionStart::scotch && has_empty ? PartitionStart::curve : options_.start;
  }

  /// The chosen start, or the best of our own, refined.
  Candidate anew() {
    Candidate candidate;
    if (const PartitionStart start = possible_start(); start == PartitionStart::scotch) {
      candidate.parts = refine(scotch_parts(comm_, graph_, architecture_.speed));
      candidate.made_by = "PT-Scotch and refinement";
    } else {
      std::vector<PartitionStart> chosen = {start};
      if (start == PartitionStart::best)
        chosen = {PartitionStart::coordinate, PartitionStart::inertial, PartitionStart::curve, PartitionStart::growth};
      std::vector<StartMaker> makers;
      for (const PartitionStart one : chosen) makers.push_back(start_maker(one));
      Divided divided =
          divide_multilevel(comm_, graph_, architecture_, makers, targets_, multilevel_settings(), count_);
      candidate.parts = std::move(divided.parts);
      candidate.made_by = name_of(chosen[divided.start]) + " and refinement";
    }
    candidate.cost = cost_of(candidate.parts);
    return levelled(std::move(candidate));
  }

  static std::string name_of(PartitionStart start) {
    if (start == PartitionStart::coordinate) return "coordinate bisection";
    if (start == PartitionStart::inertial) return "inertial bisection";
    return start == PartitionStart::growth ? "growth" : "curve";
  }

  /// From the present partition by flows, or anew where that is predicted to be cheaper.
  Candidate repaired(const Candidate& present) {
    if (options_.starts_anew) {
      Candidate other = anew();
      finish(present, other);
      return other;
    }
    Candidate best = {refine(present.parts), "flows and refinement", {}, 0};
    best.cost = cost_of(best.parts);
    finish(present, best);
    if (present.cost.imbalance > start_anew_from) {
      Candidate other = anew();
      finish(present, other);
      if (predicted(other) < predicted(best) - anew_gain) best = std::move(other);
    }
    return best;
  }

  Real predicted(const Candidate& candidate) const {
    return candidate.cost.cost + options_.moving_cost * candidate.moved;
  }

  void finish(const Candidate& present, Candidate& candidate) {
    relabel_parts(comm_, graph_, architecture_, present.parts, candidate.parts);
    candidate.cost = cost_of(candidate.parts);
    candidate = levelled(std::move(candidate));
    candidate.moved = moved_work(present.parts, candidate.parts);
  }

  /// Where links or speeds differ: moves the targets until t_p + C_p is level over the parts, and keeps the best.
  Candidate levelled(Candidate best) {
    if (architecture_.has_equal_links() && architecture_.has_equal_speeds()) return best;
    const Real total = std::accumulate(targets_.begin(), targets_.end(), Real{0});
    std::vector<Real> targets = targets_;
    const Real tolerance = levelling_tolerance();
    Candidate current = best;
    int since_best = 0;
    for (int round = 0; round < levelling_rounds && since_best < levelling_patience; ++round) {
      move_targets(current.cost, targets, total);
      std::vector<int> parts = current.parts;
      parts.resize(static_cast<std::size_t>(graph_.vertices()));
      graph_.halo.update_copies(std::span<std::int32_t>(parts), 1);
      PairRefiner refiner(comm_, graph_, architecture_, std::move(parts), targets);
      refiner.diffuse(tolerance, 6);
      refiner.smooth(1.3 * tolerance, {2, 3, 1, 100});
      refiner.tidy(tolerance);
      count_.add(refiner.count());
      current.parts = std::move(refiner).take_parts();
      current.parts.resize(static_cast<std::size_t>(graph_.owned()));
      current.cost = cost_of(current.parts);
      ++since_best;
      if (current.cost.cost >= best.cost.cost) continue;
      best = current;
      since_best = 0;
    }
    return best;
  }

  Real levelling_tolerance() const {
    const Real mine = graph_.weights.empty() ? 0 : *std::max_element(graph_.weights.begin(), graph_.weights.end());
    const Real grain = comm_.max(mine) / *std::min_element(targets_.begin(), targets_.end());
    return std::clamp(2 * grain, least_levelling_tolerance, largest_levelling_tolerance);
  }

  void move_targets(const PartitionCost& cost, std::vector<Real>& targets, Real total) const {
    constexpr Real damping = 0.8;
    constexpr Real least = 0.05;
    const Real speeds = architecture_.total_speed();
    Real level = 0;
    for (std::size_t p = 0; p < targets.size(); ++p) level += architecture_.speed[p] * cost.times[p] / speeds;
    Real sum = 0;
    for (std::size_t p = 0; p < targets.size(); ++p) {
      const Real change = damping * (level - cost.times[p]) * architecture_.speed[p] * total / speeds;
      targets[p] = std::max(least * targets_[p], targets[p] + change);
      sum += targets[p];
    }
    for (Real& target : targets) target *= total / sum;
  }

  Real moved_work(std::span<const int> from, std::span<const int> to) const {
    Real moved = 0;
    Real total = 0;
    for (std::size_t v = 0; v < to.size(); ++v) {
      total += graph_.weights[v];
      if (from[v] != to[v]) moved += graph_.weights[v];
    }
    return comm_.sum(moved) / comm_.sum(total);
  }

  GlobalId count_moved(std::span<const int> from, std::span<const int> to) const {
    GlobalId moved = 0;
    for (std::size_t v = 0; v < to.size(); ++v) moved += from[v] != to[v] ? 1 : 0;
    return comm_.sum(moved);
  }

  const Communicator& comm_;
  const Mesh& mesh_;
  const WorkModel& model_;
  const Architecture& architecture_;
  const PartitionOptions& options_;
  PhaseClock clock_;
  WorkGraph graph_;
  std::vector<Real> targets_;
  RefinementCount count_;
};

}  // namespace

PartitionPlan make_partition(const Communicator& comm, const Mesh& mesh, const WorkModel& model,
                             const Architecture& architecture, const PartitionOptions& options,
                             std::span<const int> from) {
  const bool has_start = comm.any(!from.empty());
  check(!has_start || from.size() == static_cast<std::size_t>(mesh.elements()), "each element has a present part");
  return Planner(comm, mesh, model, architecture, options).run(from, has_start);
}

std::string describe_plan(const PartitionPlan& plan) {
  const PartitionCost& cost = plan.after;
  std::string text = fmt::format(
      "{} parts by {}: cost {:.4f} of the ideal (before: {:.4f}), imbalance {:.2f} %, of nodes {:.2f} %\n"
      "cut {} faces and {} edges, communication volume {}, at most {} neighbours, {} stray pieces, {} empty\n",
      cost.times.size(), plan.made_by, cost.cost, plan.before.cost, 100 * cost.imbalance, 100 * cost.node_imbalance,
      cost.cut, cost.cut_edges, cost.communication_volume, cost.max_neighbours, cost.stray_pieces, cost.empty_parts);
  if (plan.moved_elements > 0)
    text += fmt::format("moved {:.2f} % of the work, {} elements\n", 100 * plan.moved, plan.moved_elements);
  return text;
}

bool is_worth_moving(const PartitionPlan& plan, const PartitionOptions& options, Real least_gain) {
  const Real gain = plan.before.cost - plan.after.cost;
  return plan.moved_elements > 0 && gain >= least_gain * plan.before.cost && gain >= options.moving_cost * plan.moved;
}

GlobalId count_differences(const Communicator& comm, const PartitionPlan& one, const PartitionPlan& other) {
  check(one.parts.size() == other.parts.size(), "plans are compared for one mesh");
  GlobalId differences = 0;
  for (std::size_t e = 0; e < one.parts.size(); ++e) differences += one.parts[e] != other.parts[e] ? 1 : 0;
  return comm.sum(differences);
}

}  // namespace malleus
