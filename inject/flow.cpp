#include "inject/flow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.hpp"
#include "base/log.hpp"
#include "fem/pressure_extension.hpp"
#include "mesh/space_filling_curve.hpp"
#include "solvers/level_set_speed.hpp"
#include "solvers/linear_database.hpp"

namespace malleus::inject {
namespace {

/// Share of the dissipation that may change before the flow is solved again whatever the front did.
constexpr Real dissipation_guard = 0.2;
/// Of what a gate asks for, from the start of an increment to its end.
constexpr Real growth_in_a_step = 2;
/// Steps are planned at the speed before them: the share of the distance that counts as all of it.
constexpr Real nearly = 0.75;
/// Share of switch_fill that rounding may take away: an increment that ends at it has reached it, on any number of
/// ranks.
constexpr Real rounding = 1e-9;

FieldSpec velocity_spec(int dim) {
  return {"velocity", "m/s", Support::node, dim, Transfer::interpolate, false};
}

}  // namespace

Flow::Flow(Scene& scene, Mixture& mixture, FrontSet& fronts, FillingState& state)
    : scene_(scene),
      mixture_(mixture),
      fronts_(fronts),
      state_(state),
      linear_(linear_options(scene.settings.common.solver.linear_method)) {
  state_.gates.resize(scene.settings.inlets.size());
  scene_.fields.declare(scene_.mesh, velocity_spec(scene_.mesh.dim));
  scene_.fields.declare(scene_.mesh, {"pressure", "Pa", Support::node, 1, Transfer::interpolate, false});
  scene_.fields.declare(scene_.mesh, {"viscosity", "Pa.s", Support::element, 1, Transfer::interpolate, true});
  scene_.fields.declare(scene_.mesh, {"strain_rate", "1/s", Support::element, 1, Transfer::interpolate, true});
  scene_.fields.declare(scene_.mesh, {"shear_rate", "1/s", Support::element, 1, Transfer::recompute, true});
  scene_.fields.declare(scene_.mesh, {"wall_shear_stress", "Pa", Support::node, 1, Transfer::recompute, true});
  if (scene.settings.common.inertia) history_.emplace(scene);
  if (mixture.has_void()) void_.emplace(scene, fronts, mixture);
  rebuild();
}

std::string Flow::purpose() const {
  const FlowUpdate& update = scene_.settings.flow.update;
  std::string when = "once";
  if (update.kind == FlowUpdate::Kind::every) when = fmt::format("every {} increments", update.every);
  if (update.kind == FlowUpdate::Kind::automatic) {
    const Real distance = scene_.settings.flow.update_distance;
    when = distance > 0 ? fmt::format("when the front has moved {:g} elements", distance) : "every increment";
  }
  if (history_) return "solves the Navier-Stokes equations every increment";
  return fronts_.size() == 0 ? "solves the Stokes equations"
                             : fmt::format("solves the Stokes equations of the mixture, {}", when);
}

FieldUse Flow::uses() const {
  return {fronts_.names(), {"velocity", "pressure", "viscosity", "strain_rate"}, {"velocity", "pressure"}};
}

void Flow::rebuild() {
  operator_ = std::make_unique<StokesOperator>(scene_.comm, scene_.mesh, scene_.geometry);
  operator_->set_viscosity(mixture_);
  operator_->leave_out_still_elements(true);
  linear_.reset();
  unknowns_ = {};
  if (void_) void_->rebuild();
  scene_.subscale_velocity.clear();
  is_solved_ = false;
}

/// With a given flow, and vents that are all behind walls or closed, nothing could go anywhere.
void Flow::refuse_blocked_vents() const {
  const bool is_imposed = std::any_of(scene_.settings.inlets.begin(), scene_.settings.inlets.end(),
                                      [](const InletSettings& inlet) { return !inlet.pressure; });
  const bool air_yields = scene_.settings.common.air.has_value();
  if (!is_imposed || scene_.settings.vents.empty() || air_yields || fronts_.has_way_out()) return;
  throw InputError(fmt::format(
      "[vent.{}] group: the flow from the inlets reaches no open part of a vent: they are covered at the start, or "
      "behind sections one element thin, where nothing flows; refine the mesh there or place other vents",
      scene_.settings.vents.front().name));
}

void Flow::start() {
  if (history_) return start_from_rest();
  const Outcome outcome = solve(0, 0);
  if (outcome.kind != Outcome::Kind::done) throw NumericsError("flow: " + outcome.why);
}

/// The velocities are those that are imposed, and zero.
void Flow::start_from_rest() {
  refresh_mixture();
  if (void_) void_->find(0);
  const std::vector<GateDrive> drives = present_drives(0);
  prepare(drives, 0, 0);
  unknowns_ = {};
  unknowns_.nodes.assign(static_cast<std::size_t>(scene_.mesh.nodes()) * (scene_.mesh.dim + 1), 0.0);
  operator_->impose_constraints(unknowns_);
  publish(drives, {});
  scene_.subscale_velocity.clear();
}

void Flow::check_conditions() {
  refuse_blocked_vents();
  refresh_mixture();
  if (void_) void_->find(0);
  prepare(asked_drives(scene_, 0), 0, 0);
}

Outcome Flow::solve_once() {
  state_.flow_updated = true;
  return is_solved_ && !is_asked_ ? Outcome::done() : solve(0, 0);
}

Outcome Flow::advance(const Increment& increment) {
  if (history_) return advance_inertia(increment);
  state_.flow_updated = increment.number == 1;  // start() solved it for this increment
  ++state_.increments_since_flow;
  if (is_due(present_drives(increment.start()))) {
    Outcome outcome = solve(increment.start(), increment.dt);
    if (outcome.kind != Outcome::Kind::done) return outcome;
    state_.flow_updated = true;
  }
  state_.seconds_since_flow += increment.dt;
  state_.time = increment.time;
  return Outcome::done();
}

Outcome Flow::advance_inertia(const Increment& increment) {
  const auto velocity = scene_.fields["velocity"].values();
  const auto earlier = scene_.fields["velocity_before"].values();
  before_ = {unknowns_, {velocity.begin(), velocity.end()}, {earlier.begin(), earlier.end()}, history_->save()};
  const Outcome outcome = solve(increment.time, increment.dt);
  if (outcome.kind != Outcome::Kind::done) return Outcome::retry(outcome.why);
  history_->accept(before_.velocity, increment.dt);
  state_.flow_updated = true;
  state_.time = increment.time;
  return Outcome::done();
}

void Flow::roll_back() {
  if (!history_) return;
  unknowns_ = before_.unknowns;
  scene_.fields["velocity"].assign(before_.velocity);
  scene_.fields["velocity_before"].assign(before_.earlier);
  history_->load(before_.history);
}

std::vector<GateDrive> Flow::present_drives(Real time) {
  std::vector<GateDrive> drives = asked_drives(scene_, time);
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const InletSettings& inlet = scene_.settings.inlets[i];
    const Real switch_volume = inlet.switch_fill.value_or(0) * (1 - rounding) * scene_.cavity;
    if (!state_.gates[i].switched && inlet.switch_fill && state_.filled >= switch_volume) {
      state_.gates[i].switched = true;
      log::info("inlet {} switches over to {:.4g} Pa at a fill of {:.4g}", inlet.name, *inlet.then_pressure,
                state_.filled / scene_.cavity);
    }
    if (state_.gates[i].switched) drives[i] = {GateDrive::Kind::pressure, *inlet.then_pressure};
  }
  return drives;
}

bool Flow::is_due(const std::vector<GateDrive>& drives) {
  if (!is_solved_ || is_asked_ || std::isfinite(largest_step())) return true;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const GateDrive& present = state_.gates[i].drive;
    if (drives[i].kind != present.kind || drives[i].value != present.value) return true;
  }
  const FlowSettings& flow = scene_.settings.flow;
  if (fronts_.size() == 0 || flow.update.kind == FlowUpdate::Kind::once) return false;
  if (flow.update.kind == FlowUpdate::Kind::every) return state_.increments_since_flow > flow.update.every;
  if (state_.travelled >= nearly * flow.update_distance || dissipation_changed()) return true;
  return state_.travelled > 0 && fronts_.is_near_open_vent(flow.update_distance * scene_.element_size);
}

/// What the gates ask for at a time over what they asked for at the last solve, the largest. Collective.
Real Flow::growth_of_drives(Real time) const {
  Real largest = 1;
  const std::vector<GateDrive> drives = asked_drives(scene_, time);
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const GateState& gate = state_.gates[i];
    if (gate.switched || gate.drive.kind != drives[i].kind || !(gate.drive.value > 0)) continue;
    largest = std::max(largest, drives[i].value / gate.drive.value);
  }
  return largest;
}

Real Flow::step_with_gates(Real step) const {
  const auto& inlets = scene_.settings.inlets;
  if (!std::isfinite(step) || std::ranges::none_of(inlets, &InletSettings::depends_on_time)) return step;
  const Real at_start = growth_of_drives(state_.time);
  Real dt = step / at_start;
  Real at_end = growth_of_drives(state_.time + dt) / at_start;
  const Real shortest = dt / at_end;
  while (at_end > growth_in_a_step && dt > shortest) {
    dt = std::max(dt / 2, shortest);
    at_end = growth_of_drives(state_.time + dt) / at_start;
  }
  return dt;
}

/// sum V |eta_new - eta_old| gamma^2 over sum V eta_new gamma^2, with the flow as it was.
bool Flow::dissipation_changed() {
  refresh_mixture();
  const std::span<const Real> rate = operator_->shear_rate();
  const std::span<const Real> old_viscosity = operator_->viscosity();
  std::vector<Real> viscosity(rate.size());
  std::vector<Real> slope(rate.size());
  mixture_.evaluate(scene_.mesh, rate, viscosity, slope);
  std::array<Real, 2> sums = {0, 0};
  for (std::size_t e = 0; e < rate.size(); ++e) {
    const Real weight = scene_.measures[e] * rate[e] * rate[e];
    sums[0] += weight * std::abs(viscosity[e] - old_viscosity[e]);
    sums[1] += weight * viscosity[e];
  }
  scene_.comm.sum_in_place(sums);
  return sums[0] > dissipation_guard * sums[1];
}

void Flow::refresh_mixture() {
  mixture_.update(scene_.mesh, fronts_.level_sets());
}

/// A wall with `only = FLUID` holds the nodes that this fluid reaches; a vent closes where a fluid has reached it.
StickingNodes Flow::sticking_nodes() const {
  StickingNodes sticks = fronts_.sealed_vent_nodes();
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::wall)) {
    const int only = scene_.settings.fluid_index(scene_.settings.walls[part->index].only);
    if (only < 0) continue;
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (!part->normals->holds(node)) continue;
      bool in_background = true;
      bool is_there = false;
      for (const FluidLevelSet& level_set : fronts_.level_sets()) {
        const bool inside = level_set.values[static_cast<std::size_t>(node)] > 0;
        in_background = in_background && !inside;
        is_there = is_there || (inside && level_set.fluid == only);
      }
      if (is_there || (in_background && only == mixture_.background())) sticks[static_cast<std::size_t>(node)] = 1;
    }
  }
  return sticks;
}

Outcome Flow::solve(Real time, Real dt) {
  refresh_mixture();
  if (void_) void_->find(time);
  std::vector<GateDrive> drives = present_drives(time);
  const auto velocity = scene_.fields["velocity"].values();
  const std::vector<Real> old_velocity(velocity.begin(), velocity.end());
  const bool was_solved = is_solved_;
  // Where the front has moved, the hierarchy of the flow before wastes iterations; and no run depends on its past.
  linear_.reset();
  Outcome outcome = solve_with(drives, time, dt);
  if (outcome.kind == Outcome::Kind::done && switch_over(drives)) outcome = solve_with(drives, time, dt);
  if (outcome.kind != Outcome::Kind::done) return outcome;
  if (was_solved && !history_) note_freezing(old_velocity);
  is_asked_ = false;
  state_.filled_at_flow = state_.filled;
  state_.travelled = 0;
  state_.seconds_since_flow = 0;
  state_.increments_since_flow = 0;
  return outcome;
}

/// Gates whose pressure has reached the one at which they switch. Returns whether there were any.
bool Flow::switch_over(std::vector<GateDrive>& drives) {
  bool any = false;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const InletSettings& inlet = scene_.settings.inlets[i];
    GateState& gate = state_.gates[i];
    if (gate.switched || !inlet.switch_pressure || gate.pressure < *inlet.switch_pressure) continue;
    log::info("inlet {} switches over to {:.4g} Pa at a pressure of {:.4g} Pa", inlet.name, *inlet.then_pressure,
              gate.pressure);
    gate.switched = true;
    drives[i] = {GateDrive::Kind::pressure, *inlet.then_pressure};
    any = true;
  }
  return any;
}

NewtonOptions Flow::newton_options() const {
  const SolverSettings& solver = scene_.settings.common.solver;
  NewtonOptions options;
  options.tolerance = solver.newton_tolerance;
  options.linear_tolerance = solver.linear_tolerance;
  options.max_iterations = solver.max_newton;
  if (!history_ || !is_solved_) options.start_shear_rate = typical_shear_rate(scene_);
  return options;
}

std::vector<std::size_t> Flow::prepare(const std::vector<GateDrive>& drives, Real time, Real dt) {
  FlowConditions conditions = make_conditions(scene_, mixture_, drives, sticking_nodes(), time);
  if (void_) void_->add_to(conditions, dt);
  operator_->set_constraints(std::move(conditions.constraints));
  operator_->set_loads(std::move(conditions.loads));
  operator_->set_gates(std::move(conditions.gates));
  if (history_) operator_->set_inertia(history_->inertia(mixture_, dt));
  operator_->prepare();
  pressure_is_free_ = operator_->pressure_is_free();
  return conditions.gate_inlets;
}

Outcome Flow::solve_with(const std::vector<GateDrive>& drives, Real time, Real dt) {
  const std::vector<std::size_t> gate_inlets = prepare(drives, time, dt);
  StokesState unknowns = is_solved_ ? unknowns_ : operator_->start_state();
  operator_->impose_constraints(unknowns);
  const NewtonOutcome newton = NewtonSolver(newton_options()).solve(*operator_, linear_, unknowns);
  totals_.solves += newton.linear_solves;
  totals_.iterations += newton.linear_iterations;
  totals_.assembly_s += newton.assembly_seconds;
  totals_.setup_s += newton.setup_seconds;
  totals_.solve_s += newton.solve_seconds;
  if (!newton.converged) {
    ++totals_.failures;
    return Outcome::fail(newton.reason);
  }
  unknowns_ = std::move(unknowns);
  is_solved_ = true;
  ++state_.flow_solves;
  publish(drives, gate_inlets);
  return Outcome::done();
}

/// Into the cavity through the inlets, m^3/s.
Real Flow::inflow(std::span<const Real> velocity) const {
  Real sum = 0;
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    sum -= outflow(scene_, part->facets, velocity);
  }
  return sum;
}

void Flow::publish(const std::vector<GateDrive>& drives, const std::vector<std::size_t>& gate_inlets) {
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  const std::span<Real> velocity = scene_.fields["velocity"].values();
  const std::span<Real> pressure = scene_.fields["pressure"].values();
  for (std::size_t node = 0; node < pressure.size(); ++node) {
    std::copy_n(unknowns_.nodes.data() + node * (dim + 1), dim, velocity.data() + node * dim);
    pressure[node] = unknowns_.nodes[node * (dim + 1) + dim];
  }
  extend_pressure(scene_.comm, scene_.mesh, operator_->viscosity(), operator_->force_density(), pressure);
  if (void_) void_->fill(operator_->viscosity(), inflow(velocity), unknowns_);
  const std::span<Real> viscosity = scene_.fields["viscosity"].values();
  const std::span<Real> strain_rate = scene_.fields["strain_rate"].values();
  operator_->update_viscosity(unknowns_);
  for (std::size_t e = 0; e < viscosity.size(); ++e) {
    viscosity[e] = operator_->viscosity()[e];
    strain_rate[e] = viscosity[e] > 0 ? operator_->shear_rate()[e] / std::sqrt(3.0) : 0;
  }
  scene_.subscale_velocity = operator_->subscale_velocity(unknowns_);
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    GateState& gate = state_.gates[part->index];
    gate.drive = drives[part->index];
    gate.flow = -outflow(scene_, part->facets, velocity);
    gate.pressure =
        gate.drive.kind == GateDrive::Kind::pressure ? gate.drive.value : surface_mean(scene_, *part, pressure);
  }
  for (std::size_t g = 0; g < gate_inlets.size(); ++g) {
    state_.gates[gate_inlets[g]].pressure = unknowns_.borders[g];
  }
}

void Flow::note_freezing(std::span<const Real> old_velocity) {
  if (fronts_.size() == 0 || state_.seconds_since_flow == 0) return;
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  std::vector<Real> change(velocity.begin(), velocity.end());
  for (std::size_t i = 0; i < change.size(); ++i) change[i] -= old_velocity[i];
  constexpr int root_mean_square = 2;
  Real largest = 0;  // of the fronts
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    const std::span<const Real> level_set = std::as_const(fronts_).values(i);
    largest = std::max(
        largest, front_crossing_rate(scene_.comm, scene_.mesh, scene_.node_sizes, change, level_set, root_mean_square));
  }
  freezing_error_ += 0.5 * state_.seconds_since_flow * largest;
}

nlohmann::json Flow::save() const {
  nlohmann::json saved = {
      {"borders", unknowns_.borders}, {"freezing_error", freezing_error_}, {"is_solved", is_solved_}};
  if (void_) saved["void"] = void_->save();
  if (history_) saved["history"] = history_->save();
  return saved;
}

void Flow::load(const nlohmann::json& saved) {
  freezing_error_ = saved.at("freezing_error");
  is_solved_ = saved.at("is_solved");
  if (!is_solved_) {  // saved behind a remesh after which the run failed
    if (history_) history_->load(saved.at("history"));
    return;
  }
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  const std::span<const Real> velocity = scene_.fields["velocity"].values();
  const std::span<const Real> pressure = scene_.fields["pressure"].values();
  unknowns_.borders = saved.at("borders").get<std::vector<Real>>();
  unknowns_.nodes.resize(pressure.size() * (dim + 1));
  for (std::size_t node = 0; node < pressure.size(); ++node) {
    std::copy_n(velocity.data() + node * dim, dim, unknowns_.nodes.data() + node * (dim + 1));
    unknowns_.nodes[node * (dim + 1) + dim] = pressure[node];
  }
  refresh_mixture();
  std::vector<GateDrive> drives;
  for (const GateState& gate : state_.gates) drives.push_back(gate.drive);
  prepare(drives, state_.time, 0);
  if (void_) void_->load(saved.at("void"));
  operator_->update_viscosity(unknowns_);
  if (history_) {
    history_->load(saved.at("history"));
    return;  // the subscales come with save_local(), or with the next solve, which is before they are wanted
  }
  scene_.subscale_velocity = operator_->subscale_velocity(unknowns_);
}

std::vector<Real> Flow::save_local() const {
  if (!is_solved_) return {};
  std::vector<Real> saved = unknowns_.nodes;
  for (const std::span<const Real> values :
       {operator_->viscosity(), operator_->shear_rate(), std::span<const Real>(scene_.subscale_velocity)}) {
    saved.insert(saved.end(), values.begin(), values.end());
  }
  return saved;
}

void Flow::load_local(std::span<const Real> saved) {
  if (!is_solved_) return;
  const auto take = [&](std::size_t count) {
    check(count <= saved.size(), "a saved flow fits its mesh");
    const std::span<const Real> taken = saved.first(count);
    saved = saved.subspan(count);
    return taken;
  };
  const std::size_t elements = operator_->viscosity().size();
  const std::span<const Real> nodes = take(unknowns_.nodes.size());
  unknowns_.nodes.assign(nodes.begin(), nodes.end());
  const std::span<const Real> viscosity = take(elements);
  operator_->restore_viscosity(viscosity, take(elements));
  const std::span<const Real> subscales = take(scene_.subscale_velocity.size());
  scene_.subscale_velocity.assign(subscales.begin(), subscales.end());
}

PrescribedFlow::PrescribedFlow(Scene& scene, FillingState& state) : scene_(scene), state_(state) {
  state_.gates.resize(scene.settings.inlets.size());
  scene_.fields.declare(scene_.mesh, velocity_spec(scene_.mesh.dim));
}

Outcome PrescribedFlow::advance(const Increment& increment) {
  evaluate(increment.start());
  state_.time = increment.time;
  return Outcome::done();
}

void PrescribedFlow::evaluate(Real time) {
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  const std::span<Real> velocity = scene_.fields["velocity"].values();
  std::vector<Real> component(static_cast<std::size_t>(scene_.mesh.nodes()));
  bool is_finite = true;
  for (std::size_t c = 0; c < dim; ++c) {
    const auto& formula = scene_.settings.flow.prescribed[c];
    std::fill(component.begin(), component.end(), 0);
    if (formula) formula->evaluate(scene_.mesh.coordinates, scene_.mesh.dim, time, component);
    for (std::size_t node = 0; node < component.size(); ++node) {
      is_finite = is_finite && std::isfinite(component[node]);
      velocity[node * dim + c] = component[node];
    }
  }
  if (!scene_.comm.all(is_finite)) {
    throw InputError(fmt::format("[flow] prescribed: the velocity is not a number everywhere at {:.6g} s", time));
  }
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    state_.gates[part->index].flow = -outflow(scene_, part->facets, velocity);
  }
}

Real typical_shear_rate(const Scene& scene) {
  const Box box = bounding_box(scene.comm, scene.mesh.coordinates, scene.mesh.dim);
  Real height = 1e300;
  for (std::size_t c = 0; c < static_cast<std::size_t>(scene.mesh.dim); ++c) {
    height = std::min(height, box.high[c] - box.low[c]);
  }
  Real rate = 0;
  const std::vector<GateDrive> drives = asked_drives(scene, 0);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::inlet)) {
    const Real gap = std::min(height, scene.mesh.dim == 2 ? part->area : std::sqrt(part->area));
    if (drives[part->index].kind == GateDrive::Kind::pressure) continue;
    rate = std::max(rate, std::abs(drives[part->index].value) / part->area / gap);
  }
  for (const BoundarySettings& boundary : scene.settings.common.boundaries) {
    for (const auto& component : boundary.imposed_velocity()) {
      if (component && component->is_constant()) rate = std::max(rate, std::abs((*component)({}, 0)) / height);
    }
  }
  return rate > 0 ? rate : 1;
}

}  // namespace malleus::inject
