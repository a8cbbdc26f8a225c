#include "engine/rebalancing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/log.hpp"
#include "engine/resources.hpp"
#include "mesh/simplex.hpp"
#include "partition/migrate.hpp"

namespace malleus {
namespace {

constexpr Real least_counted_gain = 0.005;  ///< of F, below which nothing is moved
constexpr Real least_measured_gain = 0.02;  ///< likewise; speeds are noisy
constexpr Real equal_speeds = 0.05;         ///< differences below it are noise
constexpr int patience = 2;                 ///< increments in a row in which speeds must differ from those in force
constexpr Real damping = 0.5;               ///< of new measurements
constexpr std::size_t told_after = 3;       ///< increments, whose mean wall time is compared

Real mean(const std::vector<Real>& values) {
  return std::accumulate(values.begin(), values.end(), Real{0}) / static_cast<Real>(values.size());
}

std::string pairs_across(const PartitionPlan& plan) {
  if (plan.before.cut_couplings + plan.after.cut_couplings == 0) return "";
  return fmt::format("; {} contact couplings between ranks instead of {}", plan.after.cut_couplings,
                     plan.before.cut_couplings);
}

}  // namespace

Real measure_element_rate(const Mesh& mesh) {
  constexpr int passes = 3;
  constexpr Real least_s = 2e-3;
  if (mesh.elements() == 0) return 0;
  Real best = 0;
  for (int pass = 0; pass < passes; ++pass) {
    const Real start = wall_clock();
    Real done = 0;
    Real sum = 0;
    while (wall_clock() - start < least_s) {
      with_dim(mesh.dim, [&](auto d) {
        constexpr int D = decltype(d)::value;
        for (LocalId e = 0; e < mesh.elements(); ++e) sum += simplex_volume<D>(simplex_points<D>(mesh, e));
      });
      done += mesh.elements();
    }
    // The sum of volumes is used, so that the loop is made; it is never negative.
    if (sum >= 0) best = std::max(best, done / (wall_clock() - start));
  }
  return best;
}

Rebalancing::Rebalancing(const PartitionSettings& settings, RebalancedScene scene)
    : settings_(settings),
      scene_(std::move(scene)),
      speeds_(static_cast<std::size_t>(scene_.comm->size()), 1),
      smoothed_(speeds_) {}

std::string Rebalancing::purpose() const {
  return is_measured() ? "shares of the ranks by measured speeds (not repeatable)"
                       : "shares of the ranks by counted work, where the mesh is another one";
}

nlohmann::json Rebalancing::save() const {
  return {{"ranks", scene_.comm->size()}, {"elements", elements_seen_}, {"times", times_}, {"speeds", speeds_}};
}

void Rebalancing::restore(const nlohmann::json& state) {
  times_ = state.at("times");
  if (state.at("ranks") != scene_.comm->size()) return;  // shares were dealt anew, on other processors
  elements_seen_ = state.at("elements");
  speeds_ = state.at("speeds").get<std::vector<Real>>();
  smoothed_ = speeds_;
}

/// Whether the speeds have differed from those in force for long enough to act on it.
bool Rebalancing::update_speeds() {
  std::vector<Real> rates = scene_.comm->gather_to_all(measure_element_rate(*scene_.mesh));
  const auto busy = static_cast<Real>(std::count_if(rates.begin(), rates.end(), [](Real rate) { return rate > 0; }));
  if (busy == 0) return false;
  const Real usual = std::accumulate(rates.begin(), rates.end(), Real{0}) / busy;
  Real apart = 0;
  for (std::size_t p = 0; p < rates.size(); ++p) {
    const Real speed = rates[p] > 0 ? rates[p] / usual : 1;
    smoothed_[p] += damping * (speed - smoothed_[p]);
    apart = std::max(apart, std::abs(smoothed_[p] / speeds_[p] - 1));
  }
  increments_apart_ = apart > equal_speeds ? increments_apart_ + 1 : 0;
  return increments_apart_ >= patience;
}

void Rebalancing::repartition(const Increment& increment) {
  Architecture machine = equal_architecture(scene_.comm->size());
  machine.speed = is_measured() ? smoothed_ : speeds_;
  speeds_ = machine.speed;
  increments_apart_ = 0;
  elements_seen_ = scene_.mesh->total_elements;
  const std::vector<int> here(static_cast<std::size_t>(scene_.mesh->elements()), scene_.comm->rank());
  WorkModel model = solver_work();
  if (scene_.couplings) model.couplings = scene_.couplings();
  const PartitionOptions options;
  const PartitionPlan plan = make_partition(*scene_.comm, *scene_.mesh, model, machine, options, here);
  const Real least_gain = is_measured() ? least_measured_gain : least_counted_gain;
  if (!is_worth_moving(plan, options, least_gain)) return;
  migrate(*scene_.comm, *scene_.mesh, *scene_.fields, plan.parts);
  scene_.mesh_moved();
  ++times_;
  expected_gain_ = 1 - plan.after.cost / plan.before.cost;
  before_s_ = increments_s_.empty() ? 0 : mean(increments_s_);
  increments_s_.clear();
  log::info(
      "balance: in increment {} an increment is expected to take {:.3f} of the ideal instead of {:.3f}, {:.0f} % less; "
      "{:.1f} % of the work moved by {}{}{}",
      increment.number, plan.after.cost, plan.before.cost, 100 * expected_gain_, 100 * plan.moved, plan.made_by,
      pairs_across(plan),
      is_measured() ? fmt::format("; measured speeds {:.2f} to {:.2f} of the mean (not repeatable)",
                                  *std::min_element(speeds_.begin(), speeds_.end()),
                                  *std::max_element(speeds_.begin(), speeds_.end()))
                    : "");
}

/// Increments differ in what they solve, so the comparison is of means and for the reader only.
void Rebalancing::tell_gain(const Increment& increment) {
  if (before_s_ <= 0 || increments_s_.size() < told_after) return;
  const Real now = mean(increments_s_);
  log::info(
      "balance: by increment {} increments take {:.3g} s, {:.3g} s before the last move: {:.0f} % less ({:.0f} % "
      "expected)",
      increment.number - 1, now, before_s_, 100 * (1 - now / before_s_), 100 * expected_gain_);
  before_s_ = 0;
}

Outcome Rebalancing::advance(const Increment& increment) {
  if (scene_.comm->size() == 1 || increment.number == last_increment_) return Outcome::done();
  const Real now = wall_clock();
  if (last_start_s_ > 0) {
    increments_s_.push_back(now - last_start_s_);
    if (increments_s_.size() > told_after) increments_s_.erase(increments_s_.begin());
  }
  last_start_s_ = now;
  last_increment_ = increment.number;
  tell_gain(increment);
  const bool another_mesh = elements_seen_ != scene_.mesh->total_elements;
  const bool other_speeds = is_measured() && update_speeds();
  if (another_mesh || other_speeds) repartition(increment);
  return Outcome::done();
}

}  // namespace malleus
