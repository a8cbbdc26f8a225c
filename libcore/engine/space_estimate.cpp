#include "engine/space_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/log.hpp"
#include "engine/resources.hpp"
#include "remesh/distributed.hpp"

namespace malleus {
namespace {

constexpr Real coarsening = 2;           ///< of sizes, from one mesh to the next
constexpr Real least_ratio = 1.2;        ///< of mean sizes: below it two meshes do not tell apart
constexpr GlobalId fewest_elements = 8;  ///< of a mesh that says something
constexpr Real lowest_order = 1;
constexpr Real highest_order = 4;
constexpr Real theoretical_order = 2;
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

Real observed_order(const MeshComparison& comparison) {
  if (!comparison.difference2 || !(comparison.first_difference > 0)) return theoretical_order;
  const Real growth = *comparison.difference2 / comparison.first_difference;
  if (growth <= 1) return theoretical_order;  // too coarse for an order to show
  return std::clamp(std::log(growth) / std::log(comparison.second_ratio), lowest_order, highest_order);
}

Real extrapolated_error(const MeshComparison& comparison) {
  return comparison.first_difference / (std::pow(comparison.first_ratio, observed_order(comparison)) - 1);
}

/// The fine process' state on a mesh of about twice the sizes; null where there is none.
std::unique_ptr<Process> SpaceEstimate::coarser(const Process& fine, FieldStore& fine_fields) const {
  Mesh mesh = fine.mesh();
  FieldStore fields = copy_of(mesh, fine_fields);
  std::vector<Real> sizes = current_sizes(comm_, mesh).values();
  for (Real& size : sizes) size *= coarsening;
  DistributedRemeshOptions options;
  options.local.keep_volume = true;
  remesh_distributed(comm_, mesh, fields, Metric::per_node(std::move(sizes)), options);
  if (mesh.total_elements < fewest_elements || size_ratio(fine.mesh(), mesh) < least_ratio) return nullptr;
  std::unique_ptr<Process> twin = factory_(mesh);
  twin->restore(std::move(mesh), taken_from(fields), fine.save_state());
  twin->solve_all_next();
  return twin;
}

void SpaceEstimate::prepare(Process& process) {
  twins_.clear();
  if (!factory_) return;
  const log::Silence silence;
  try {
    if (auto twin = coarser(process, process.fields())) twins_.push_back(std::move(twin));
    if (twins_.empty()) return;
    if (auto twin = coarser(*twins_.front(), twins_.front()->fields())) twins_.push_back(std::move(twin));
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
  std::vector<std::vector<Real>> coarse;
  for (const auto& twin : twins_) {
    auto results = results_of(*twin, increment);
    if (!results || results->size() != fine.size()) break;
    coarse.push_back(std::move(*results));
  }
  if (!coarse.empty() && scale > 0) {
    MeshComparison comparison;
    comparison.first_ratio = size_ratio(process.mesh(), twins_[0]->mesh());
    comparison.first_difference = difference(fine, coarse[0], scale);
    if (coarse.size() > 1) {
      comparison.difference2 = difference(coarse[0], coarse[1], scale);
      comparison.second_ratio = size_ratio(twins_[0]->mesh(), twins_[1]->mesh());
    }
    const Real error = extrapolated_error(comparison);
    if (std::isfinite(error)) {
      saved_ = {{"error", error},
                {"order", observed_order(comparison)},
                {"meshes", coarse.size() + 1},
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
                0, theoretical_order};
    Real scale = 0;
    for (const Real result : results[0]) scale += std::abs(result);
    if (results.size() > 1 && results[1].size() == results[0].size() && scale > 0) {
      const Real second_ratio = size_ratio(twins_[0]->mesh(), twins_[1]->mesh());
      const Real of_twin = difference(results[0], results[1], scale) / (std::pow(second_ratio, theoretical_order) - 1);
      outlook->error = of_twin / std::pow(ratio, theoretical_order);
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
