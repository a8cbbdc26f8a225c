#include "engine/remeshing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "base/error.hpp"
#include "base/log.hpp"
#include "engine/resources.hpp"
#include "parallel/agreement.hpp"
#include "parallel/fault.hpp"
#include "remesh/error_metric.hpp"

namespace malleus {
namespace {

constexpr const char* size_field_name = "mesh_size";

constexpr Real no_smallest = 1e-100;
constexpr Real no_largest = 1e100;

/// Elements below this (1 regular, 0 flat, in metric space) are not left in a mesh, whatever the case says.
constexpr Real emergency_quality = 0.1;
/// With `auto`: the worst element has lost this share of what it was after the last remesh, or one per cent of all
/// elements are this bad, or so many edges no longer have the wanted length.
constexpr Real kept_share_of_quality = 0.45;
constexpr Real tolerated_quality = 0.3;
constexpr Real tolerated_p01 = 0.35;
constexpr Real tolerated_conforming = 0.75;
constexpr Real tolerated_conforming_by_error = 0.5;  ///< an estimated error moves the wanted sizes all the time

}  // namespace

Remeshing::Remeshing(const RemeshSettings& settings, RemeshedScene scene)
    : settings_(settings), scene_(std::move(scene)) {
  if (settings_.size || follows_error()) return;
  const Metric sizes = current_sizes(*scene_.comm, *scene_.mesh);
  Field& kept =
      scene_.fields->declare(*scene_.mesh, {size_field_name, "m", Support::node, 1, Transfer::interpolate, true});
  kept.assign(sizes.values());
}

std::string Remeshing::purpose() const {
  const std::string when = settings_.every ? fmt::format("every {} increments", *settings_.every)
                                           : "when quality or edge lengths ask for it";
  std::string sizes = "the input's local sizes";
  if (settings_.size) sizes = fmt::format("size {:g} m", *settings_.size);
  if (settings_.error) sizes = fmt::format("sizes for a relative error of {:g}", *settings_.error);
  if (settings_.nodes) sizes = fmt::format("about {} nodes where the flow bends", *settings_.nodes);
  return "a new mesh " + when + ", " + sizes;
}

Metric Remeshing::base_metric() const {
  const Mesh& mesh = *scene_.mesh;
  const ErrorMetricOptions bounds = {settings_.anisotropic, settings_.min_size.value_or(no_smallest),
                                     settings_.max_size.value_or(no_largest)};
  if (settings_.nodes) {
    return error_metric(*scene_.comm, mesh, (*scene_.fields)[scene_.flow_field], static_cast<Real>(*settings_.nodes),
                        bounds);
  }
  if (settings_.error)
    return error_sizes(*scene_.comm, mesh, (*scene_.fields)[scene_.flow_field], *settings_.error, bounds);
  if (settings_.size)
    return Metric::per_node(std::vector<Real>(static_cast<std::size_t>(mesh.nodes()), *settings_.size));
  const auto sizes = std::as_const(*scene_.fields)[size_field_name].values();
  return Metric::per_node({sizes.begin(), sizes.end()});
}

Metric Remeshing::wanted_metric() const {
  if (settings_.size && !scene_.refine) return Metric::uniform(*settings_.size);
  Metric metric = base_metric();
  if (scene_.refine) scene_.refine(metric);
  bound_sizes(metric, settings_.min_size.value_or(no_smallest), settings_.max_size.value_or(no_largest));
  limit_gradation(*scene_.comm, *scene_.mesh, metric, settings_.gradation);
  return metric;
}

bool Remeshing::is_due(const Increment& increment, const MetricFit& fit) const {
  if (fit.inverted > 0 || fit.quality_min < emergency_quality) return true;
  if (scene_.asks && scene_.asks(increment)) return true;
  const bool knows_sizes = !follows_error() || increment.number > 1;
  const bool misfits = fit.conforming < (follows_error() ? tolerated_conforming_by_error : tolerated_conforming);
  if (settings_.every) {
    const bool on_time = increment.number > 1 && (increment.number - 1) % *settings_.every == 0;
    return on_time || (times_ == 0 && knows_sizes && misfits);
  }
  return fit.quality_min < std::min(tolerated_quality, kept_share_of_quality * quality_after_) ||
         fit.quality_p01 < tolerated_p01 || (knows_sizes && misfits);
}

Outcome Remeshing::advance(const Increment& increment) {
  const bool again = increment.number == last_increment_;  // the step was cut: the mesh was looked at already
  last_increment_ = increment.number;
  if (again) return Outcome::done();
  const Metric metric = wanted_metric();
  const MetricFit fit = metric_fit(*scene_.comm, *scene_.mesh, metric);
  return is_due(increment, fit) ? remesh(increment, metric) : Outcome::done();
}

/// Mesh and fields as they are, for the case that no new mesh comes about: a remesh that fails leaves them half-way.
class Remeshing::Backup {
 public:
  explicit Backup(const RemeshedScene& scene) : mesh_(*scene.mesh) {
    for (const Field* field : std::as_const(*scene.fields).all()) {
      values_.emplace(field->spec().name, std::vector<Real>(field->values().begin(), field->values().end()));
    }
  }

  void put_back(const RemeshedScene& scene) {
    *scene.mesh = std::move(mesh_);
    for (Field* field : scene.fields->all()) {
      const std::string name = field->spec().name;
      if (values_.contains(name)) {
        field->assign(std::move(values_.at(name)));
      } else {
        scene.fields->remove(name);  // the remesher's own
      }
    }
    scene.mesh_changed();
  }

 private:
  Mesh mesh_;
  std::map<std::string, std::vector<Real>> values_;
};

Outcome Remeshing::remesh(const Increment& increment, const Metric& metric) {
  const Real start = wall_clock();
  DistributedRemeshOptions options;
  options.local.keep_volume = scene_.keep_volume;
  options.kept_regions = scene_.kept_regions;
  options.balances_by_cost = scene_.balances_by_cost;
  if (scene_.before) scene_.before();
  Backup backup(scene_);
  DistributedRemeshReport report;
  try {
    report = remesh_distributed(*scene_.comm, *scene_.mesh, *scene_.fields, metric, options);
    agree(*scene_.comm, [] { pass_fault_point("new_mesh"); });
  } catch (const InputError& error) {  // raised on all ranks alike: the surface has come to touch itself
    backup.put_back(scene_);
    return Outcome::fail(fmt::format("the mesh cannot be made anew: {}", error.what()));
  }
  if (report.after.inverted > 0) {
    backup.put_back(scene_);
    return Outcome::fail(
        fmt::format("{} elements are turned over and no operation could repair them", report.after.inverted));
  }
  quality_after_ = report.after.quality_min;
  remeshed_in_ = increment.number;
  ++times_;
  if (scene_.made_anew) scene_.made_anew();
  scene_.mesh_changed();
  log::info("remeshed: {} nodes (before: {}), quality min {:.2f}, mean {:.2f} (before: {:.2f}, {:.2f}), {:.1f} s",
            report.nodes_after, report.nodes_before, report.after.quality_min, report.after.quality_mean,
            report.before.quality_min, report.before.quality_mean, wall_clock() - start);
  return Outcome::done();
}

}  // namespace malleus
