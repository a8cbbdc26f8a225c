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
constexpr Real usual_order = 1.75;
constexpr Real growth_of_time = 1.1;  ///< of an increment's time with the number of elements, as an exponent

Real size_ratio(const Mesh& fine, const Mesh& coarse) {
  return std::pow(static_cast<Real>(fine.total_elements) / static_cast<Real>(coarse.total_elements), 1.0 / fine.dim);
}

Real difference(const std::vector<Real>& a, const std::vector<Real>& b, Real scale) {
  Real sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / scale;
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
std::unique_ptr<Process> SpaceEstimate::coarser(const Process& finest, const Process& fine, FieldStore& fine_fields,
                                                Real coarsening) const {
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
  twin->solve_all_next();
  twin->stand_as_it_is(size_ratio(finest.mesh(), twin->mesh()));
  return twin;
}

void SpaceEstimate::prepare(Process& process) {
  twins_.clear();
  if (!factory_) return;
  const log::Silence silence;
  try {
    const Process* finer = &process;
    FieldStore* fields = &process.fields();
    for (const Real coarsening : coarsenings) {
      auto twin = coarser(process, *finer, *fields, coarsening);
      if (!twin) return;
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

std::optional<Outlook> SpaceEstimate::look_ahead(const Process& process, Real largest_step, bool steady) {
  std::vector<Real> seconds;
  std::vector<std::vector<Real>> results;
  std::vector<Real> elements;
  for (const auto& twin : twins_) {
    const Real began = wall_clock();
    const auto found = first_results_of(*twin, largest_step, steady);
    if (!found) break;
    seconds.push_back(comm_.max(wall_clock() - began));
    results.push_back(*found);
    elements.push_back(static_cast<Real>(twin->mesh().total_elements));
  }
  std::optional<Outlook> outlook;
  if (!results.empty()) {
    const Real ratio = size_ratio(process.mesh(), twins_[0]->mesh());
    outlook =
        Outlook{seconds[0] * std::pow(static_cast<Real>(process.mesh().total_elements) / elements[0], growth_of_time),
                0, usual_order};
    Real scale = 0;
    for (const Real result : results[0]) scale += std::abs(result);
    if (results.size() > 1 && results[1].size() == results[0].size() && scale > 0) {
      const Real second_ratio = size_ratio(twins_[0]->mesh(), twins_[1]->mesh());
      const Real of_twin = difference(results[0], results[1], scale) / (std::pow(second_ratio, usual_order) - 1);
      outlook->error = of_twin / std::pow(ratio, usual_order);
    }
  }
  twins_.clear();
  return outlook;
}

std::optional<std::vector<Real>> SpaceEstimate::first_results_of(Process& twin, Real largest_step, bool steady) const {
  {
    const log::Silence silence;
    try {
      if (!steady) {
        for (Component* component : twin.components()) component->start();
      }
    } catch (const InputError&) {
      return std::nullopt;
    } catch (const NumericsError&) {
      return std::nullopt;
    }
  }
  if (steady) return results_of(twin, std::nullopt);
  const Real dt = std::min(largest_step, twin.largest_step());
  if (!std::isfinite(dt) || !(dt > 0)) return std::nullopt;
  return results_of(twin, Increment{1, dt, dt});
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
