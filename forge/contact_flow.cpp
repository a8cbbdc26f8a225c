#include "forge/contact_flow.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "base/log.hpp"
#include "mesh/simplex.hpp"
#include "solvers/linear_database.hpp"

namespace malleus::forge {
namespace {

constexpr int most_searches = 4;  ///< of contact points in one solve, where tools are curved
constexpr std::array<Real, 2> guess_tolerances = {3e-2, 1e-3};
constexpr int most_passes = 12;  ///< of augmentation and friction limits
/// Of the rate at which bodies strain, that their volumes are given back.
constexpr Real largest_volume_share = 5e-2;
constexpr int tries_before_picard = 3;  ///< of an increment, each with half the step
constexpr int most_picard_steps = 400;
/// A node may end this share of an edge deeper in a tool than its linearised gap says.
constexpr Real tolerated_surprise = 0.02;

}  // namespace

ContactFlow::ContactFlow(Scene& scene)
    : scene_(scene), linear_(linear_options(scene.solver.linear_method)), contact_(scene.dim()) {
  mesh_changed();
}

std::string ContactFlow::purpose() const {
  std::string text = "velocity and pressure by Newton's method";
  if (!scene_.tools.empty()) text += ", " + std::to_string(scene_.tools.size()) + " rigid tools";
  if (!scene_.pairs.empty()) text += ", " + std::to_string(scene_.pairs.size()) + " contacts between bodies";
  return text;
}

FieldUse ContactFlow::uses() const {
  return {{}, {field_name::velocity, field_name::pressure, field_name::strain_rate, field_name::viscosity}, {}};
}

void ContactFlow::mesh_changed() {
  operator_ = std::make_unique<StokesOperator>(*scene_.comm, scene_.mesh, scene_.geometry);
  operator_->set_viscosity(*scene_.viscosity);
  linear_.reset();
  memory_.clear();
  contact_.points().clear();
  is_transferred_ = false;
}

void ContactFlow::remeshed() {
  mesh_changed();
  is_transferred_ = true;
}

void ContactFlow::save() {
  saved_.fields.clear();
  for (const Field* field : std::as_const(scene_.fields).all()) {
    saved_.fields.emplace_back(field->values().begin(), field->values().end());
  }
  saved_.memory = memory_;
  saved_.presses.clear();
  for (const Tool& tool : scene_.tools) saved_.presses.push_back(tool.press().state());
  saved_.targets = scene_.progress.volume_targets;
  saved_.asked = scene_.progress.asked_strains;
  saved_.report = report_;
  saved_.edge_rate = edge_rate_;
  saved_.strain_rate = strain_rate_;
  saved_.was_pushed = scene_.progress.was_pushed;
}

void ContactFlow::roll_back() {
  std::size_t i = 0;
  for (Field* field : scene_.fields.all()) field->assign(saved_.fields[i++]);
  memory_ = saved_.memory;
  for (std::size_t t = 0; t < scene_.tools.size(); ++t) scene_.tools[t].press().restore(saved_.presses[t]);
  scene_.progress.volume_targets = saved_.targets;
  scene_.progress.asked_strains = saved_.asked;
  report_ = saved_.report;
  edge_rate_ = saved_.edge_rate;
  strain_rate_ = saved_.strain_rate;
  scene_.progress.was_pushed = saved_.was_pushed;
}

std::vector<Real> ContactFlow::save_memory() const {
  std::vector<Real> saved;
  for (const ContactMemory& memory : memory_) {
    saved.insert(saved.end(), {static_cast<Real>(memory.slave), static_cast<Real>(memory.opponent), memory.normal[0],
                               memory.normal[1], memory.normal[2], memory.multiplier, memory.pressure});
  }
  return saved;
}

void ContactFlow::restore_memory(std::span<const Real> saved) {
  constexpr std::size_t numbers = 7;
  memory_.clear();
  for (std::size_t i = 0; i + numbers <= saved.size(); i += numbers) {
    memory_.push_back({static_cast<LocalId>(saved[i]), static_cast<int>(saved[i + 1]),
                       Vector(saved[i + 2], saved[i + 3], saved[i + 4]), saved[i + 5], saved[i + 6]});
  }
}

Outcome ContactFlow::advance(const Increment& increment) {
  save();
  linear_.reset();  // what is kept from the increment before would not be there after a restart
  report_ = {};
  tries_ = increment.number == tried_increment_ ? tries_ + 1 : 1;
  tried_increment_ = increment.number;
  update_softening(scene_);
  const std::vector<Real> start = scene_.mesh.coordinates;
  const Outcome outcome = run_stages(increment);
  scene_.mesh.coordinates = start;
  if (outcome.kind != Outcome::Kind::done) roll_back();
  return outcome;
}

Outcome ContactFlow::solve_once() {
  return advance({0, scene_.progress.time + 1e-6 / scene_.scale.rate(), 1e-6 / scene_.scale.rate()});
}

/// The solve at the start of the increment gives the forces and the fields; Runge-Kutta solves again at the middle.
Outcome ContactFlow::run_stages(const Increment& increment) {
  const Real last_step = scene_.progress.last_step;
  TimeScheme scheme = scene_.motion.scheme;
  if (scheme == TimeScheme::adams_bashforth_2 && !(last_step > 0)) scheme = TimeScheme::runge_kutta_2;
  const auto velocity = std::as_const(scene_.fields)[field_name::velocity].values();
  const auto strain_rate = std::as_const(scene_.fields)[field_name::strain_rate].values();
  const std::vector<Real> last_rate(strain_rate.begin(), strain_rate.end());
  Stage stage;
  stage.start_time = increment.start();
  stage.time = increment.start();
  stage.displacement = scheme == TimeScheme::adams_bashforth_2 ? adams_bashforth_step(increment.dt, last_step)
                                                               : euler_step(increment.dt);
  stage.start = scene_.mesh.coordinates;
  stage.before.assign(velocity.begin(), velocity.end());
  if (const Outcome outcome = solve_under_presses(stage); outcome.kind != Outcome::Kind::done) return outcome;

  if (const Outcome outcome = check_room(increment.start()); outcome.kind != Outcome::Kind::done) return outcome;
  if (const Outcome outcome = check_blows(increment.dt); outcome.kind != Outcome::Kind::done) return outcome;
  if (keeps_stress_) compute_stress(scene_, scene_.fields[field_name::stress].values());
  const Displacement& way = stage.displacement;
  scene_.step_velocity.resize(velocity.size());
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    scene_.step_velocity[i] = way.now * velocity[i] + way.before * stage.before[i];
  }
  scene_.step_strain_rate.resize(strain_rate.size());
  for (std::size_t e = 0; e < strain_rate.size(); ++e) {
    scene_.step_strain_rate[e] = std::max(0.0, way.now * strain_rate[e] + way.before * last_rate[e]);
  }
  displacement_ = way;
  if (scheme == TimeScheme::adams_bashforth_2 && way.before == 0) scheme = TimeScheme::runge_kutta_2;
  const bool halts = any_press([&](const Press& press) { return press.is_stalled(increment.start()); });
  if (scheme == TimeScheme::runge_kutta_2 && scene_.progress.was_pushed && !halts)
    return run_midpoint(increment, stage);
  return Outcome::done();
}

Outcome ContactFlow::run_midpoint(const Increment& increment, const Stage& first) {
  std::vector<std::vector<Real>> at_start;
  for (const Field* field : std::as_const(scene_.fields).all()) {
    at_start.emplace_back(field->values().begin(), field->values().end());
  }
  const FlowReport report = report_;
  const std::vector<ContactMemory> memory = memory_;
  for (std::size_t i = 0; i < scene_.mesh.coordinates.size(); ++i) {
    scene_.mesh.coordinates[i] = first.start[i] + 0.5 * increment.dt * scene_.step_velocity[i];
  }
  if (has_turned_elements(scene_)) return Outcome::retry("an element would turn over within the step");
  Stage stage = first;
  stage.time = increment.start() + 0.5 * increment.dt;
  for (Tool& tool : scene_.tools) tool.plan(stage.start_time, stage.displacement, stage.time);
  const Outcome outcome = solve(stage);
  if (outcome.kind != Outcome::Kind::done) return outcome;
  const auto velocity = std::as_const(scene_.fields)[field_name::velocity].values();
  scene_.step_velocity.assign(velocity.begin(), velocity.end());
  const auto strain_rate = std::as_const(scene_.fields)[field_name::strain_rate].values();
  scene_.step_strain_rate.assign(strain_rate.begin(), strain_rate.end());
  std::size_t i = 0;
  for (Field* field : scene_.fields.all()) field->assign(at_start[i++]);
  const int iterations = report_.newton_iterations - report.newton_iterations;
  report_ = report;
  report_.midpoint_iterations = iterations;
  memory_ = memory;
  return Outcome::done();
}

Outcome ContactFlow::solve(const Stage& stage) {
  const FreeSurface surface(*scene_.comm, scene_.mesh, scene_.geometry, scene_.boundaries->is_free());
  state_.nodes.resize(static_cast<std::size_t>(scene_.mesh.nodes()) * static_cast<std::size_t>(scene_.dim() + 1));
  const Field& velocity = scene_.fields[field_name::velocity];
  const Field& pressure = scene_.fields[field_name::pressure];
  const auto dim = static_cast<std::size_t>(scene_.dim());
  for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
    Real* unknowns = state_.nodes.data() + static_cast<std::size_t>(node) * (dim + 1);
    std::copy_n(velocity.at(node), dim, unknowns);
    unknowns[dim] = *pressure.at(node);
  }
  const auto moves = [](Real unknown) { return unknown != 0; };
  is_cold_ = !scene_.comm->any(std::any_of(state_.nodes.begin(), state_.nodes.end(), moves));
  if (const Outcome outcome = solve_contacts(stage, surface); outcome.kind != Outcome::Kind::done) return outcome;
  measure_forces();
  store_fields();
  measure_rates();
  return Outcome::done();
}

Outcome ContactFlow::solve_contacts(const Stage& stage, const FreeSurface& surface) {
  for (int search = 0; search < most_searches; ++search) {
    find_points(stage, surface);
    scene_.progress.was_pushed = is_pushed(stage.time);
    if (!scene_.progress.was_pushed) {
      std::fill(state_.nodes.begin(), state_.nodes.end(), 0.0);
      note_touching(stage, surface);
      rest();
      return Outcome::done();
    }
    prepare_operator(stage);
    if (const Outcome outcome = guess_limits(stage, surface); outcome.kind != Outcome::Kind::done) return outcome;
    for (int pass = 0;; ++pass) {
      if (const Outcome outcome = run_newton(tolerance_); outcome.kind != Outcome::Kind::done) return outcome;
      if (!update_contacts(stage, surface, pass)) break;
      if (pass == most_passes) return Outcome::retry("the contact pressures did not settle");
    }
    note_touching(stage, surface);
    if (surprise(stage, surface) <= tolerated_surprise) return Outcome::done();
  }
  return Outcome::retry("nodes end within a tool");
}

/// Solutions that need not be exact, for better limits of friction: those of a first exact one would be wrong anyway.
Outcome ContactFlow::guess_limits(const Stage& stage, const FreeSurface& surface) {
  if (!has_limited_friction()) return Outcome::done();
  for (const Real tolerance : guess_tolerances) {
    if (tolerance <= tolerance_) break;
    if (const Outcome outcome = run_newton(tolerance); outcome.kind != Outcome::Kind::done) return outcome;
    measure_contacts(stage, surface);
    if (!update_friction(surface)) break;
  }
  return Outcome::done();
}

Vector ContactFlow::velocity_of(LocalId node) const {
  const auto at = static_cast<std::size_t>(node) * static_cast<std::size_t>(scene_.dim() + 1);
  return to_vector(state_.nodes.data() + at, scene_.dim());
}

Vector ContactFlow::position_at_end(const Stage& stage, LocalId node) const {
  const auto at = static_cast<std::size_t>(node) * static_cast<std::size_t>(scene_.dim());
  const Displacement& way = stage.displacement;
  return to_vector(stage.start.data() + at, scene_.dim()) +
         way.step * (way.now * velocity_of(node) + way.before * to_vector(stage.before.data() + at, scene_.dim()));
}

Prediction ContactFlow::predict(const Stage& stage) const {
  Prediction prediction;
  prediction.effective_step = stage.displacement.step * stage.displacement.now;
  Real speed = 0;
  Bounds box;
  for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
    prediction.positions.push_back(position_at_end(stage, node));
    prediction.velocities.push_back(velocity_of(node));
    speed = std::max(speed, prediction.velocities.back().norm());
    box.add(prediction.positions.back());
  }
  for (const Tool& tool : scene_.tools) speed = std::max(speed, box.empty() ? 0 : tool.largest_speed(box));
  prediction.largest_motion = scene_.comm->max(std::max(speed, scene_.scale.speed)) * stage.displacement.step;
  return prediction;
}

/// [region] Pa, of the surface nodes under pressure.
std::vector<Real> ContactFlow::mean_contact_pressure(const FreeSurface& surface) const {
  const Field& pressure = std::as_const(scene_.fields)[field_name::contact_pressure];
  std::vector<Real> sums(scene_.bodies.size() * 2, 0.0);
  for (std::size_t place = 0; place < surface.nodes().size(); ++place) {
    const LocalId node = surface.nodes()[place];
    const Real here = *pressure.at(node);
    if (!(here > 0)) continue;
    const auto body = static_cast<std::size_t>(surface.body_of_node(node));
    sums[2 * body] += surface.area(place) * here;
    sums[2 * body + 1] += surface.area(place);
  }
  scene_.comm->sum_in_place(sums);
  std::vector<Real> means;
  for (std::size_t i = 0; i < sums.size(); i += 2) means.push_back(sums[i + 1] > 0 ? sums[i] / sums[i + 1] : 0);
  return means;
}

void ContactFlow::find_points(const Stage& stage, const FreeSurface& surface) {
  const std::vector<Real> shear_stress = has_limited_friction() ? nodal_shear_stress() : std::vector<Real>();
  ContactScene contact_scene;
  contact_scene.surface = &surface;
  contact_scene.tools = &scene_.tools;
  contact_scene.pairs = scene_.pairs;
  contact_scene.bodies = scene_.body_scales;
  contact_scene.shear_stress = shear_stress;
  if (scene_.thermal) contact_scene.softening = scene_.thermal->node_softening;
  contact_scene.memory = memory_;
  contact_scene.settings = scene_.contact;
  std::vector<Real> mean_pressure;
  if (scene_.fields.has(field_name::contact_pressure) && !scene_.comm->any(!memory_.empty())) {
    contact_scene.last_pressure = std::as_const(scene_.fields)[field_name::contact_pressure].values();
    mean_pressure = mean_contact_pressure(surface);
    contact_scene.mean_pressure = mean_pressure;
  }
  contact_.points() = find_contacts(*scene_.comm, contact_scene, predict(stage));
  std::vector<GlobalId> wanted;
  for (const ContactPoint& point : contact_.points()) {
    for (const GlobalId master : point.masters) {
      if (master >= 0) wanted.push_back(master);
    }
  }
  contact_space_ = std::make_unique<NodeSpace>(*scene_.comm, scene_.mesh, wanted);
  has_contacts_ = scene_.comm->any(!contact_.points().empty());
}

/// Whether anything would act on bodies at rest.
bool ContactFlow::is_pushed(Real time) const {
  if (scene_.boundaries->has_loads() || scene_.boundaries->largest_speed(time) > 0) return true;
  bool pushed = false;
  for (const ContactPoint& point : contact_.points()) {
    const Real closing = point.normal.offset + point.normal.normal.dot(point.opponent_velocity);
    pushed = pushed || closing > 1e-9 * scene_.scale.speed;
  }
  return scene_.comm->any(pushed);
}

void ContactFlow::rest() {
  std::fill(state_.nodes.begin(), state_.nodes.end(), 0.0);
  contact_.points().clear();
  tractions_.clear();
  slips_.clear();
  gaps_.clear();
  memory_.clear();
  has_contacts_ = false;
}

void ContactFlow::prepare_operator(const Stage& stage) {
  StokesLoads loads = scene_.boundaries->loads(stage.time);
  volume_targets(stage, loads);
  operator_->set_constraints(scene_.boundaries->constraints(stage.time));
  operator_->set_loads(std::move(loads));
  std::vector<ResidualTerm*> terms;
  if (has_contacts_) terms.push_back(&contact_);
  operator_->set_terms(std::move(terms));
  operator_->prepare();
  operator_->impose_constraints(state_);
}

/// Speed of what drives the bodies now, m/s: a press at its force limit may stand still.
Real ContactFlow::driving_speed(Real time) const {
  if (scene_.boundaries->has_loads()) return scene_.scale.speed;
  Real speed = scene_.boundaries->largest_speed(time);
  for (const Tool& tool : scene_.tools) {
    if (tool.moves()) speed = std::max(speed, tool.velocity_at(tool.start().pivot).norm());
    if (tool.motion().rotation.squaredNorm() > 0) speed = std::max(speed, scene_.scale.speed);
  }
  return speed;
}

/// Asks each body's lost volume back: the displacement of the increment shall have the volume strain ln(V0 / V), and
/// besides what this increment is expected to lose by the last one's measure (the schemes' error of third order). Not
/// faster than a small share of what strains the body, else its forces would show it: a remesh may change more volume
/// than a short step can give back, and a full die gives none.
void ContactFlow::volume_targets(const Stage& stage, StokesLoads& loads) {
  const Displacement& way = stage.displacement;
  const bool by_scheme = scene_.motion.scheme != TimeScheme::euler;
  const VolumeTarget choice = scene_.motion.volume_target;
  if (choice == VolumeTarget::no || (choice == VolumeTarget::automatic && !by_scheme)) return;
  Progress& progress = scene_.progress;
  const Real ratio = progress.last_step > 0 ? way.step / progress.last_step : 0;
  const Real fastest = largest_volume_share * driving_speed(stage.start_time) / scene_.scale.height;
  std::vector<Real> targets;
  for (std::size_t region = 0; region < scene_.bodies.size(); ++region) {
    const Body& body = scene_.bodies[region];
    Real target = 0;
    if (body.is_deformable() && body.volume > 0) {
      const Real expected = progress.volume_losses[region] * ratio * ratio * ratio;
      const Real wanted = std::log(body.start_volume / body.volume) - expected;
      const Real before = way.before * saved_.targets[region];
      target = std::clamp((wanted / way.step - before) / way.now, -fastest, fastest);
      progress.asked_strains[region] = way.step * (way.now * target + before);
    }
    targets.push_back(target);
  }
  progress.volume_targets = targets;
  for (const std::int32_t region : scene_.mesh.element_region) {
    loads.element_divergence.push_back(targets[static_cast<std::size_t>(region)]);
  }
}

/// The Newton loop; where a linear solve hits the floor of rounding (stiff penalties, sharp tolerances) again with
/// looser ones, for it is the nonlinear residual that decides. Where shorter steps did not help, Picard's method.
Outcome ContactFlow::run_newton(Real tolerance) {
  NewtonOptions options;
  options.tolerance = tolerance;
  options.linear_tolerance = scene_.solver.linear_tolerance;
  options.max_iterations = scene_.solver.max_newton;
  const std::vector<Real> start = state_.nodes;
  Outcome outcome = Outcome::done();
  for (int attempt = 0; attempt < 3; ++attempt) {
    const NewtonOutcome newton = run_newton_once(options);
    if (newton.converged) return Outcome::done();
    outcome = Outcome::retry(newton.reason);
    if (newton.reason.find("linear solver") == std::string::npos) break;
    options.linear_tolerance = std::min(1e2 * options.linear_tolerance, 1e-2);
  }
  if (tries_ <= tries_before_picard) return outcome;
  state_.nodes = start;
  return run_picard(tolerance);
}

Outcome ContactFlow::run_picard(Real tolerance) {
  NewtonOptions options;
  options.tolerance = tolerance;
  options.linear_tolerance = scene_.solver.linear_tolerance;
  options.picard_alone = true;
  // It contracts by 1 - m: so many iterations, and half as many again for contacts, lead to the tolerance.
  const Real contraction = std::max(1 - scene_.viscosity->sensitivity(), 0.1);
  options.max_iterations = most_picard_steps;
  if (contraction < 1) {
    const Real needed = 20 + 1.5 * std::log(tolerance) / std::log(contraction);
    options.max_iterations = static_cast<int>(std::min<Real>(needed, most_picard_steps));
  }
  log::info("Newton's method did not converge in shorter steps: Picard's method, {} iterations at most",
            options.max_iterations);
  const NewtonOutcome picard = run_newton_once(options);
  if (picard.converged) return Outcome::done();
  return Outcome::fail("neither Newton's nor Picard's method converges, in steps cut " + std::to_string(tries_ - 1) +
                       " times: " + picard.reason);
}

std::vector<Real> ContactFlow::shear_rates() const {
  const auto strain_rate = std::as_const(scene_.fields)[field_name::strain_rate].values();
  std::vector<Real> rates;
  for (const Real rate : strain_rate) rates.push_back(std::sqrt(3.0) * rate);
  return rates;
}

NewtonOutcome ContactFlow::run_newton_once(const NewtonOptions& asked) {
  NewtonOptions options = asked;
  const std::vector<Real> earlier_rates = is_transferred_ && !is_cold_ ? shear_rates() : std::vector<Real>();
  options.start_shear_rates = earlier_rates;
  if (is_cold_) options.start_shear_rate = std::sqrt(3.0) * scene_.scale.rate();
  const NewtonOutcome outcome = NewtonSolver(options).solve(*operator_, linear_, state_);
  report_.newton_iterations += outcome.iterations();
  report_.residual = outcome.residual;
  is_cold_ = is_cold_ && !outcome.converged;
  is_transferred_ = is_transferred_ && !outcome.converged;
  totals_.linear_solves += outcome.linear_solves;
  totals_.linear_iterations += outcome.linear_iterations;
  totals_.linear_failures += outcome.converged ? 0 : 1;
  totals_.assembly_seconds += outcome.assembly_seconds;
  totals_.setup_seconds += outcome.setup_seconds;
  totals_.solve_seconds += outcome.solve_seconds;
  for (const NewtonIteration& iteration : outcome.history) {
    log::debug("  {} residual {:.2e} step {:.2g}, {} linear iterations", iteration.newton ? "newton" : "picard",
               iteration.residual, iteration.step, iteration.linear_iterations);
  }
  return outcome;
}

Real ContactFlow::time_to_touch(Real time) {
  Real least = std::numeric_limits<Real>::infinity();
  const FreeSurface surface(*scene_.comm, scene_.mesh, scene_.geometry, scene_.boundaries->is_free());
  for (Tool& tool : scene_.tools) {
    tool.plan(time, euler_step(0));
    const Real speed = tool.velocity_at(tool.start().pivot).norm();
    if (!(speed > 0)) continue;
    for (const LocalId node : surface.nodes()) {
      const auto body = static_cast<std::size_t>(surface.body_of_node(node));
      if (!scene_.bodies[body].is_deformable()) continue;
      const Real distance = tool.distance_at_end(to_vector(scene_.mesh.point(node), scene_.dim()));
      least = std::min(least, distance > 1e-9 * scene_.scale.height ? distance / speed : 0.0);
    }
  }
  return scene_.comm->min(least);
}

}  // namespace malleus::forge
