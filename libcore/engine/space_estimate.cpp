#include "engine/space_estimate.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "base/log.hpp"
#include "engine/resources.hpp"
#include "remesh/distributed.hpp"

namespace malleus {
namespace {

/// Of sizes, from one mesh to the next: twice and three times the finest. Larger steps leave the range in which errors
/// follow a power of the size, shorter ones show little but chance.
constexpr std::array<Real, 2> coarsenings = {2, 1.5};
constexpr Real least_ratio = 1.2;  ///< of mean sizes: below it two meshes do not tell apart
constexpr std::array<GlobalId, 4> fewest_elements = {0, 0, 8, 30};  ///< [dimension] of a mesh that says something

Real size_ratio(const Mesh& fine, const Mesh& coarse) {
  return std::pow(static_cast<Real>(fine.total_elements) / static_cast<Real>(coarse.total_elements), 1.0 / fine.dim);
}

/// What part of a run on its own mesh told, over what was extrapolated from coarser ones.
Rehearsal with_own_part(const Rehearsal& own, const Rehearsal& extrapolated) {
  constexpr Real enough_increments = 4;
  constexpr Real enough_progress = 0.7;  // increments are not spread evenly: coarser meshes tell better how many follow
  Rehearsal run = extrapolated;
  run.first_s = own.first_s;
  run.other_error = own.other_error;
  if (own.done >= enough_increments || own.done >= own.increments) run.later_s = own.later_s;
  if (own.done >= enough_progress * own.increments) run.increments = own.increments;
  return run;
}

Outlook outlook_on(const Rehearsal& run, bool is_steady) {
  Outlook outlook;
  outlook.increment_s = is_steady ? run.first_s : run.later_s;
  outlook.increments = run.increments;
  outlook.first_s = run.first_s;
  outlook.other_error = run.other_error;
  outlook.solves = run.solves;
  return outlook;
}

FieldStore copy_of(const Mesh& mesh, const FieldStore& fields) {
  FieldStore copy;
  for (const Field* field : fields.all()) {
    const auto values = field->values();
    copy.declare(mesh, field->spec()).assign({values.begin(), values.end()});
  }
  return copy;
}

std::vector<std::pair<FieldSpec, std::vector<Real>>> taken_from(const FieldStore& fields) {
  std::vector<std::pair<FieldSpec, std::vector<Real>>> list;
  for (const Field* field : fields.all()) {
    const auto values = field->values();
    list.emplace_back(field->spec(), std::vector<Real>(values.begin(), values.end()));
  }
  return list;
}

}  // namespace

/// The fine process' state on a mesh of about so many times the sizes; null where there is none.
std::unique_ptr<Process> SpaceEstimate::coarser(const Process& fine, FieldStore& fine_fields, Real coarsening) const {
  Mesh mesh = fine.mesh();
  FieldStore fields = copy_of(mesh, fine_fields);
  std::vector<Real> sizes = current_sizes(comm_, mesh).values();
  for (Real& size : sizes) size *= coarsening;
  DistributedRemeshOptions options;
  options.local.keep_volume = true;
  remesh_distributed(comm_, mesh, fields, Metric::per_node(std::move(sizes)), options);
  if (mesh.total_elements < fewest_elements[static_cast<std::size_t>(mesh.dim)] ||
      size_ratio(fine.mesh(), mesh) < least_ratio)
    return nullptr;
  std::unique_ptr<Process> twin = factory_(mesh);
  twin->restore(std::move(mesh), taken_from(fields), fine.save_state());
  return twin;
}

int estimates_of_run(const Process& process, const RunPlan& plan) {
  return plan.is_steady() || !process.solves_again() ? 1 : 2;
}

void SpaceEstimate::prepare(Process& process) {
  make_twins(process, true);
}

void SpaceEstimate::make_twins(Process& process, bool compares) {
  twins_.clear();
  if (!factory_) return;
  const log::Silence silence;
  try {
    const Process* finer = &process;
    FieldStore* fields = &process.fields();
    for (const Real coarsening : coarsenings) {
      auto twin = coarser(*finer, *fields, coarsening);
      if (!twin) return;
      if (compares) {
        twin->solve_all_next();
        twin->stand_as_it_is(size_ratio(process.mesh(), twin->mesh()));
      }
      finer = twins_.emplace_back(std::move(twin)).get();
      fields = &twins_.back()->fields();
    }
  } catch (const InputError&) {  // a scene that cannot be set up on a mesh that coarse: fewer meshes are compared
  } catch (const NumericsError&) {
  }
}

std::optional<std::vector<Real>> SpaceEstimate::results_of(Process& process,
                                                           const std::optional<Increment>& increment) const {
  const log::Silence silence;
  try {
    for (Component* component : process.components()) {
      if (component->name() == "remeshing") continue;
      const Outcome outcome = increment ? component->advance(*increment) : component->solve_once();
      if (outcome.kind != Outcome::Kind::done) return std::nullopt;
    }
  } catch (const InputError&) {
    return std::nullopt;
  } catch (const NumericsError&) {
    return std::nullopt;
  }
  return process.results();
}

void SpaceEstimate::compare(Process& process, const std::optional<Increment>& increment) {
  if (twins_.empty()) return;
  const std::vector<Real> fine = process.results();
  Real scale = 0;
  for (const Real result : fine) scale += std::abs(result);
  MeshComparison comparison = {{1}, {fine}};
  for (const auto& twin : twins_) {
    auto results = results_of(*twin, increment);
    if (!results || results->size() != fine.size()) break;
    comparison.sizes.push_back(size_ratio(process.mesh(), twin->mesh()));
    comparison.results.push_back(std::move(*results));
    log::debug("estimate on {} nodes, {:.3g} times the sizes: {:.6g}; on {}: {:.6g}", twin->mesh().total_nodes(),
               comparison.sizes.back(), fmt::join(comparison.results.back(), ", "), process.mesh().total_nodes(),
               fmt::join(fine, ", "));
  }
  if (comparison.sizes.size() > 1 && scale > 0) {
    const Real error = extrapolated_error(comparison);
    if (std::isfinite(error)) {
      saved_ = {{"error", error},
                {"order", observed_order(comparison)},
                {"meshes", comparison.sizes.size()},
                {"dimension", process.mesh().dim}};
    }
  }
  twins_.clear();
}

std::optional<Outlook> SpaceEstimate::look_ahead(Process& process, const RunPlan& plan, Real most_s) {
  Outlook outlook;
  const Real began = comm_.sum(processor_seconds());
  make_twins(process, false);
  outlook.making_s = comm_.sum(processor_seconds()) - began;
  std::vector<Rehearsal> seen;
  for (const auto& twin : twins_) {
    auto rehearsal = rehearse(comm_, *twin, plan, most_s / static_cast<Real>(twins_.size()));
    if (!rehearsal) break;
    outlook.coarse_s += rehearsal->first_s;
    seen.push_back(std::move(*rehearsal));
  }
  twins_.clear();
  if (seen.empty() && factory_ && most_s > 0) {  // no coarser mesh holds it: its own tells time, but not its error
    const auto own = rehearse(comm_, process, plan, most_s);
    if (own) return outlook_on(*own, plan.is_steady());
  }
  if (seen.empty()) return std::nullopt;
  const Mesh& mesh = process.mesh();
  const auto nodes = static_cast<Real>(mesh.total_nodes());
  Rehearsal run = extrapolated_run(seen, nodes, mesh.dim, process.steps_follow_sizes());
  MeshComparison comparison;
  if (run.first_s + 2 * run.later_s < most_s) {
    if (const auto own = rehearse(comm_, process, plan, most_s)) {
      run = with_own_part(*own, run);
      comparison = {{1}, {own->results}};
    }
  }
  const Outlook costs = outlook;
  outlook = outlook_on(run, plan.is_steady());
  outlook.making_s = costs.making_s;
  outlook.coarse_s = costs.coarse_s;
  const Real base = comparison.sizes.empty() ? seen[0].nodes : nodes;  // the finest of which results are known
  for (const Rehearsal& one : seen) {
    comparison.sizes.push_back(std::pow(base / one.nodes, 1.0 / mesh.dim));
    comparison.results.push_back(one.results);
  }
  const auto is_comparable = [&](const auto& results) { return results.size() == comparison.results[0].size(); };
  if (comparison.sizes.size() < 2 || !std::ranges::all_of(comparison.results, is_comparable)) return outlook;
  outlook.error = extrapolated_error(comparison) / std::pow(nodes / base, usual_order / mesh.dim);
  return outlook;
}

std::optional<ErrorShare> SpaceEstimate::share(bool remeshes) const {
  if (saved_.is_null()) return std::nullopt;
  const Real order = saved_.at("order");
  const int dim = saved_.at("dimension");
  ErrorShare share;
  share.source = "space";
  share.relative = saved_.at("error");
  share.basis = fmt::format("an increment on {} meshes, of observed order {:.2g}", Real(saved_.at("meshes")), order);
  share.knob = remeshes ? "[remesh] size" : "the sizes of [mesh] file";
  share.factor = std::pow(2.0, -1 / order);
  share.cost = std::pow(share.factor, -dim);
  return share;
}

}  // namespace malleus
