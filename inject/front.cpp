#include "inject/front.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.hpp"
#include "base/log.hpp"
#include "fem/cut_simplex.hpp"
#include "fem/level_set_volume.hpp"
#include "solvers/level_set_pockets.hpp"
#include "solvers/level_set_redistance.hpp"
#include "solvers/level_set_speed.hpp"

namespace malleus::inject {
namespace {

constexpr Real not_filled = -1;
constexpr int most_turns = 12;  ///< of parting fronts and restoring their volumes
/// Substeps follow the fastest fluid at the front up to so many times the front's own rate: beyond are a few small
/// elements that it squeezes through, where longer steps do no harm to the rest.
constexpr Real most_over_front = 4;
/// In an increment: a front that crosses a cavity of a thousand elements in one takes a tenth of that.
constexpr Real most_substeps = 2e4;
/// Marks of facets through which the fluid's share of the flow is known: 0, 1, or none of it passes.
constexpr signed char by_level_set = -1;
constexpr signed char sealed = 2;

/// Share of a facet in which a level set is positive.
Real facet_share(const Mesh& mesh, LocalId facet, std::span<const Real> level_set) {
  std::array<Real, 3> values;
  const auto nodes = mesh.nodes_of_facet(facet);
  for (std::size_t i = 0; i < nodes.size(); ++i) values[i] = level_set[static_cast<std::size_t>(nodes[i])];
  return positive_fraction({values.data(), nodes.size()});
}

/// Flow out through one facet [m^3/s].
Real facet_outflow(const Scene& scene, LocalId facet, std::span<const Real> velocity) {
  return with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    const FacetIntegrals<D> integrals = facet_integrals<D>(scene.mesh, facet, scene.geometry);
    const auto shares = integrals.shares();
    Real flow = 0;
    for (int i = 0; i < D; ++i) {
      const auto node = static_cast<std::size_t>(scene.mesh.nodes_of_facet(facet)[static_cast<std::size_t>(i)]);
      flow += shares[i] * integrals.normal.dot(Eigen::Map<const Point<D>>(velocity.data() + node * D));
    }
    return flow;
  });
}

}  // namespace

Front::Front(Scene& scene, FrontSet& fronts, FillingState& state, std::function<void(Real)> renew_velocity)
    : scene_(scene), fronts_(fronts), state_(state), renew_velocity_(std::move(renew_velocity)) {
  scene_.fields.declare(scene_.mesh, {"fill_time", "s", Support::node, 1, Transfer::interpolate, false});
  scene_.fields.declare(scene_.mesh, {"weld_angle", "deg", Support::node, 1, Transfer::recompute, true});
  if (scene_.settings.front.transport == FrontSettings::Transport::trace) traced_.emplace(scene_);
  rebuild();
}

std::string Front::purpose() const {
  if (traced_) return "traces the front back along the stream, wets the walls, restores the volume";
  return fmt::format("moves the front{} in substeps of {:g} elements, wets the walls, restores the volume",
                     fronts_.size() > 1 ? "s" : "", scene_.settings.front.cfl);
}

FieldUse Front::uses() const {
  std::vector<std::string> written = fronts_.names();
  written.emplace_back("fill_time");
  return {{"velocity"}, written, written};
}

void Front::rebuild() {
  const FrontSettings& front = scene_.settings.front;
  TransportOptions options;
  options.stabilization = front.stabilization();
  options.front_cfl = renew_velocity_ ? front.cfl : most_over_front * front.cfl;  // of what substep_rate() leaves
  options.narrow_band = front.narrow_band.value_or(0);
  transport_ = std::make_unique<LevelSetTransport>(scene_.comm, scene_.mesh, scene_.graph, options);
  wetting_ = std::make_unique<WallWetting>(scene_.comm, scene_.mesh, scene_.graph, wetted_nodes());
  open_ = open_nodes();
}

void Front::prepare_remesh() {
  for (Real& time : scene_.fields["fill_time"].values()) time = time == not_filled ? state_.time : time;
}

void Front::finish_remesh() {
  for (std::size_t i = 0; i < fronts_.size(); ++i)
    restore_volume(scene_.comm, scene_.mesh, scene_.measures, fronts_.values(i), targets_[i]);
  const std::vector<Real> filled = fronts_.united();
  const std::span<Real> fill_time = scene_.fields["fill_time"].values();
  for (std::size_t n = 0; n < filled.size(); ++n) fill_time[n] = filled[n] > 0 ? fill_time[n] : not_filled;
}

/// Nodes of gates, vents and imposed flow: there air comes in or goes out.
std::vector<char> Front::open_nodes() const {
  std::vector<char> open(static_cast<std::size_t>(scene_.mesh.nodes()), 0);
  for (const BoundaryPart& part : scene_.parts) {
    if (part.kind != BoundaryPart::Kind::inlet && !scene_.is_opening(part)) continue;
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (part.normals->holds(node)) open[static_cast<std::size_t>(node)] = 1;
    }
  }
  return open;
}

/// Nodes of the walls on which fluid stands still, those of gates apart: there the level set is imposed.
std::vector<char> Front::wetted_nodes() const {
  std::vector<char> wetted = sticking_walls(scene_);
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (part->normals->holds(node)) wetted[static_cast<std::size_t>(node)] = 0;
    }
  }
  return wetted;
}

void Front::start() {
  fronts_.part();
  targets_.clear();
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    targets_.push_back(positive_volume(scene_.comm, scene_.mesh, scene_.measures, fronts_.values(i)));
  }
  const std::vector<Real> filled = fronts_.united();
  const std::span<Real> fill_time = scene_.fields["fill_time"].values();
  for (std::size_t n = 0; n < filled.size(); ++n) fill_time[n] = filled[n] > 0 ? 0 : not_filled;
  if (traced_) {
    traced_->trace(fronts_.values(0), *wetting_);
    if (!traced_->follows_formulas()) {
      const std::span<const Real> arrival = scene_.fields["arrival_time"].values();
      std::copy(arrival.begin(), arrival.end(), fill_time.begin());
    }
  }
  state_.initial = state_.filled = std::accumulate(targets_.begin(), targets_.end(), 0.0);
}

Real Front::rate() {
  transport_->set_subscales(scene_.subscale_velocity);
  Real rate = 0;
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    rate = std::max(rate, transport_->front_rate(scene_.fields["velocity"].values(), fronts_.values(i)));
  }
  return rate;
}

Real Front::crossing_rate() const {
  Real rate = 0;
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    const std::span<const Real> level_set = std::as_const(fronts_).values(i);
    rate = std::max(rate, front_crossing_rate(scene_.comm, scene_.mesh, scene_.node_sizes, velocity, level_set));
  }
  return rate;
}

Real Front::substep_rate() {
  const Real fastest = rate();
  return renew_velocity_ ? fastest : std::min(fastest, most_over_front * crossing_rate());
}

/// One step whatever its length. Without inlets the volume that the trace finds is the answer's measure: it stays.
Outcome Front::advance_traced(const Increment& increment) {
  const std::vector<Real> before = fronts_.united();
  const Exchange through = exchange(0);
  traced_->evaluate(increment.time, fronts_.values(0));
  if (!traced_->follows_formulas()) {
    targets_[0] = std::min(targets_[0] + (through.entering - through.leaving) * increment.dt, scene_.cavity);
    state_.left += through.leaving * increment.dt;
    restore_volumes();
  }
  state_.injected += state_.inflow() * increment.dt;
  mark_fill_time(before, increment.start(), increment.dt);
  substeps_ = 1;
  return Outcome::done();
}

Outcome Front::advance(const Increment& increment) {
  snapshot();
  if (traced_) return advance_traced(increment);
  substeps_ = 0;
  Real left = increment.dt;
  while (left > 0) {
    const Real start = increment.time - left;
    if (renew_velocity_) renew_velocity_(start);
    const Real fastest = substep_rate();
    const Real wanted = std::ceil(left * fastest / scene_.settings.front.cfl - 1e-6);
    if (wanted > most_substeps) {
      roll_back();
      return Outcome::fail(
          fmt::format("the front would need {:.1g} substeps of {:g} elements in {:g} s; shorten [time] step, and look "
                      "at the units of gates and viscosities",
                      wanted, scene_.settings.front.cfl, left));
    }
    const int parts = static_cast<int>(std::max(wanted, 1.0));
    const Real dt = left / parts;
    if (renew_velocity_) renew_velocity_(start + 0.5 * dt);
    const Real crossed = dt * crossing_rate();
    Outcome outcome = substep(start, dt);
    if (outcome.kind != Outcome::Kind::done) {
      roll_back();
      return outcome;
    }
    state_.travelled += crossed;
    ++substeps_;
    left = parts == 1 ? 0 : left - dt;
  }
  return Outcome::done();
}

Outcome Front::substep(Real start, Real dt) {
  const std::vector<Real> before = fronts_.united();
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    const std::span<Real> level_set = fronts_.values(i);
    const Exchange through = exchange(i);
    const TransportReport report = transport_->advance(velocity, level_set, dt, imposed(i, dt));
    if (!report.converged) return Outcome::retry("the transport of the front did not converge");
    wetting_->apply(level_set);
    pockets_filled_ += fill_unresolved_pockets(scene_.comm, scene_.mesh, kept_apart(i), level_set);
    const bool may_redistance = scene_.settings.front.redistance == FrontSettings::Redistance::on_demand;
    if (may_redistance && should_redistance(front_slope(scene_.comm, scene_.mesh, level_set))) {
      redistance(scene_.comm, scene_.mesh, scene_.graph, scene_.measures, level_set);
      ++redistances_;
    }
    targets_[i] += (through.entering - through.leaving) * dt;
    state_.left += through.leaving * dt;
  }
  restore_volumes();
  state_.injected += state_.inflow() * dt;
  warn_of_backflow();
  mark_fill_time(before, start, dt);
  return Outcome::done();
}

/// Gates let fluid out again where the pressure inside is above theirs; what is injected is the difference.
void Front::warn_of_backflow() {
  if (warned_of_backflow_) return;
  constexpr Real noticeable = 0.02;
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    std::array<Real, 2> out = {0, 0};
    for (const LocalId f : part->facets) {
      const Real flow = facet_outflow(scene_, f, velocity);
      out[flow > 0 ? 1 : 0] += std::abs(flow);
    }
    scene_.comm.sum_in_place(out);
    if (!(out[1] > noticeable * out[0])) continue;
    warned_of_backflow_ = true;
    log::warning(
        "[{}]: {:.3g} m^3/s come in and {:.3g} m^3/s go out again through parts of the gate; volume_error counts "
        "the difference alone",
        part->section, out[0], out[1]);
  }
}

/// Nodes whose pockets are no pockets of air: where it can leave, and where another fluid is.
std::vector<char> Front::kept_apart(std::size_t front) const {
  std::vector<char> kept = open_;
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    if (i == front) continue;
    const std::span<const Real> level_set = std::as_const(fronts_).values(i);
    for (std::size_t n = 0; n < kept.size(); ++n) kept[n] = level_set[n] > 0 ? 1 : kept[n];
  }
  return kept;
}

/// To each front what came in of its fluid. Fronts that meet push into each other and are parted half-way, in turns.
void Front::restore_volumes() {
  for (int turn = 0; turn < most_turns; ++turn) {
    for (std::size_t i = 0; i < fronts_.size(); ++i) {
      restore_volume(scene_.comm, scene_.mesh, scene_.measures, fronts_.values(i), targets_[i]);
    }
    if (fronts_.size() < 2 || turn == most_turns - 1 || !fronts_.part()) return;
  }
}

Front::Exchange Front::exchange(std::size_t front) const {
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  const std::span<const Real> level_set = std::as_const(fronts_).values(front);
  std::vector<signed char> known_share(static_cast<std::size_t>(scene_.mesh.exterior_facets), by_level_set);
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    const bool is_ours = scene_.settings.fluid_index(scene_.settings.inlets[part->index].fluid) == fronts_.fluid(front);
    for (const LocalId f : part->facets) known_share[static_cast<std::size_t>(f)] = is_ours ? 1 : 0;
  }
  // What reaches a vent that it seals stays, though the flow has not been solved again yet.
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::vent)) {
    if (fronts_.seals()[part->index] == 0) continue;
    for (const LocalId f : part->facets) known_share[static_cast<std::size_t>(f)] = sealed;
  }
  std::array<Real, 2> sums = {0, 0};
  for (LocalId f = 0; f < scene_.mesh.exterior_facets; ++f) {
    const Real out = facet_outflow(scene_, f, velocity);
    if (out == 0) continue;
    const signed char known = known_share[static_cast<std::size_t>(f)];
    if (known == sealed) continue;
    const Real share = known != by_level_set && out < 0 ? known : facet_share(scene_.mesh, f, level_set);
    sums[out < 0 ? 0 : 1] += std::abs(out) * share;
  }
  scene_.comm.sum_in_place(sums);
  return {sums[0], sums[1]};
}

/// At an inlet of the fluid the level set grows as the front moves away, at another fluid's it falls; through vents the
/// background comes back; through the rest of the boundary what stands there.
ImposedLevelSet Front::imposed(std::size_t front, Real dt) const {
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  const std::span<const Real> level_set = std::as_const(fronts_).values(front);
  ImposedLevelSet result;
  std::vector<char> is_done(level_set.size(), 0);
  const auto impose = [&](LocalId node, Real value) {
    if (is_done[static_cast<std::size_t>(node)] != 0) return;
    is_done[static_cast<std::size_t>(node)] = 1;
    result.nodes.push_back(node);
    result.values.push_back(value);
  };
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    const Real flow = state_.gates[part->index].flow;
    if (!(flow > 0)) continue;
    const bool is_ours = scene_.settings.fluid_index(scene_.settings.inlets[part->index].fluid) == fronts_.fluid(front);
    const Real way = flow / part->area * dt;
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (!part->normals->holds(node)) continue;
      const Real value = level_set[static_cast<std::size_t>(node)];
      impose(node, is_ours ? std::max(value, 0.0) + way : std::min(value, 0.0) - way);
    }
  }
  for (const BoundaryPart& part : scene_.parts) {
    if (part.kind != BoundaryPart::Kind::vent && part.kind != BoundaryPart::Kind::imposed) continue;
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (!part.normals->holds(node)) continue;
      Real inward = 0;
      for (std::size_t c = 0; c < dim; ++c) {
        inward -= velocity[static_cast<std::size_t>(node) * dim + c] * part.normals->normal(node)[c];
      }
      if (!(inward > 0)) continue;
      const Real value = level_set[static_cast<std::size_t>(node)];
      impose(node, part.kind == BoundaryPart::Kind::vent ? std::min(value, 0.0) - inward * dt : value);
    }
  }
  return result;
}

void Front::mark_fill_time(const std::vector<Real>& before, Real start, Real dt) {
  const std::vector<Real> after = fronts_.united();
  const std::span<Real> fill_time = scene_.fields["fill_time"].values();
  for (std::size_t n = 0; n < after.size(); ++n) {
    if (fill_time[n] != not_filled || !(after[n] > 0)) continue;
    const Real share = before[n] < 0 ? -before[n] / (after[n] - before[n]) : 0;
    fill_time[n] = start + share * dt;
  }
}

void Front::snapshot() {
  saved_level_sets_.clear();
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    const auto values = fronts_.values(i);
    saved_level_sets_.emplace_back(values.begin(), values.end());
  }
  const auto fill_time = scene_.fields["fill_time"].values();
  saved_fill_time_.assign(fill_time.begin(), fill_time.end());
  saved_targets_ = targets_;
  saved_state_ = state_;
}

void Front::roll_back() {
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    std::copy(saved_level_sets_[i].begin(), saved_level_sets_[i].end(), fronts_.values(i).begin());
  }
  std::copy(saved_fill_time_.begin(), saved_fill_time_.end(), scene_.fields["fill_time"].values().begin());
  targets_ = saved_targets_;
  state_ = saved_state_;
}

nlohmann::json Front::save() const {
  return {{"targets", targets_}, {"redistances", redistances_}, {"pockets_filled", pockets_filled_}};
}

void Front::load(const nlohmann::json& saved) {
  targets_ = saved.at("targets").get<std::vector<Real>>();
  redistances_ = saved.at("redistances");
  pockets_filled_ = saved.at("pockets_filled");
}

}  // namespace malleus::inject
