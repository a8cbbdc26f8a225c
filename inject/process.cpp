#include "inject/process.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/log.hpp"
#include "fem/error_norms.hpp"
#include "inject/error_sources.hpp"
#include "inject/forecast.hpp"
#include "inject/front_sizes.hpp"
#include "inject/wall_loads.hpp"
#include "inject/weld_lines.hpp"

namespace malleus::inject {
namespace {

constexpr Real unlimited = std::numeric_limits<Real>::infinity();
/// Elements that the front may cross in an increment where the flow stays as it is: what an output shows.
constexpr Real frozen_stride = 4;
constexpr Real traced_stride = 16;  ///< where any number costs the same
/// Below this share of what the pressures could do a fluid is at rest.
constexpr Real share_of_rest = 1e-4;
/// Away from power-law scenes the shear-rate cut-off plays no part.
Real cut_off(const Scene& scene) {
  return scene.settings.common.solver.cutoff_strain_rate * typical_shear_rate(scene);
}

}  // namespace

Real allowed_contrast(const InjectCase& settings) {
  if (settings.front.contrast) return *settings.front.contrast;
  const bool is_filling = settings.fluids.size() > 1 && !settings.inlets.empty() && settings.time.increments != 0;
  return is_filling ? 1e4 : unlimited;
}

FillingProcess::FillingProcess(const Communicator& comm, Mesh mesh, const InjectCase& settings)
    : scene_(comm, std::move(mesh), settings), fronts_(scene_) {
  mixture_ = std::make_unique<Mixture>(make_fluids(settings, cut_off(scene_), allowed_contrast(settings)),
                                       settings.initial_fluid(), settings.front.mixture, settings.front.thickness);
  check_given_viscosities(comm, scene_.mesh, mixture_->fluids());
  thin_ = find_thin_sections(scene_);
  warn_of(thin_);
  if (!settings.common.probes.empty()) {
    probes_ = std::make_unique<Probes>(comm, scene_.mesh, settings.common.probes);
  }
}

/// The scene must have its fields: call it after all other parts were added. It runs first.
void FillingProcess::add_remeshing() {
  const CommonSections& common = scene_.settings.common;
  if (Rebalancing::is_wanted(common.partition, scene_.comm)) {
    const RebalancedScene shared = {&scene_.comm, &scene_.mesh, &scene_.fields, [this] { rebuild(); }, {}};
    rebalancing_ = std::make_unique<Rebalancing>(common.partition, shared);
    order_.insert(order_.begin(), rebalancing_.get());
  }
  const auto& settings = common.remesh;
  if (!settings || !settings->active) return;
  RemeshedScene lent;
  lent.comm = &scene_.comm;
  lent.mesh = &scene_.mesh;
  lent.fields = &scene_.fields;
  lent.flow_field = "velocity";
  lent.balances_by_cost = common.partition.method != PartitionMethod::curve;
  lent.keep_volume = true;
  if (front_) {
    lent.before = [this] { front_->prepare_remesh(); };
    lent.asks = [this](const Increment& /*any*/) { return front_left_fine_elements(scene_, fronts_); };
    if (settings->min_size) lent.refine = [this](Metric& metric) { refine_at_fronts(scene_, fronts_, metric); };
  }
  lent.mesh_changed = [this] {
    rebuild();
    if (front_) front_->finish_remesh();
  };
  remeshing_ = std::make_unique<Remeshing>(*settings, std::move(lent));
  order_.insert(order_.begin(), remeshing_.get());
}

/// Everything that stands on the mesh.
void FillingProcess::rebuild() {
  scene_.rebuild();
  if (flow_) flow_->rebuild();
  if (prescribed_) prescribed_->evaluate(state_.time);
  if (front_) front_->rebuild();
}

void FillingProcess::add_flow() {
  flow_ = std::make_unique<Flow>(scene_, *mixture_, fronts_, state_);
  order_.push_back(flow_.get());
}

void FillingProcess::add_prescribed_flow() {
  prescribed_ = std::make_unique<PrescribedFlow>(scene_, state_);
  order_.push_back(prescribed_.get());
}

void FillingProcess::check_start() {
  if (flow_) flow_->check_conditions();
  if (prescribed_) prescribed_->evaluate(0);
}

void FillingProcess::add_front() {
  fronts_.set_initial();
  way_ = way_of_fronts(scene_, fronts_);
  std::function<void(Real)> renew;
  if (prescribed_) renew = [this](Real time) { prescribed_->evaluate(time); };
  front_ = std::make_unique<Front>(scene_, fronts_, state_, std::move(renew));
  order_.push_back(front_.get());
}

void FillingProcess::add_filling() {
  filling_ = std::make_unique<Filling>(scene_, fronts_, state_);
  order_.push_back(filling_.get());
}

std::vector<LeftOut> FillingProcess::left_out() const {
  std::vector<LeftOut> left = {{"heat equation", "no [thermal] section"}};
  if (!scene_.settings.common.inertia) left.push_back({"inertia", "no [inertia] section"});
  if (!scene_.settings.common.gravity) left.push_back({"weight", "no [gravity] section"});
  if (!has_fronts()) left.push_back({"front, mixture, filling", "one fluid"});
  if (prescribed_) left.push_back({"Stokes equations", "[flow] prescribes the velocity"});
  if (!remeshing_)
    left.push_back({"remeshing", scene_.settings.common.remesh ? "[remesh] active = no" : "no [remesh] section"});
  return left;
}

std::vector<std::string> FillingProcess::accuracy_settings() const {
  const InjectCase& settings = scene_.settings;
  std::vector<std::string> lines;
  if (flow_) {
    lines.push_back(fmt::format("newton_tolerance {:g}, linear_tolerance {:g}", settings.common.solver.newton_tolerance,
                                settings.common.solver.linear_tolerance));
  }
  if (has_fronts()) {
    lines.push_back(fmt::format("front cfl {:g}, flow update_distance {:g} elements", settings.front.cfl,
                                settings.flow.update_distance));
    lines.push_back(fmt::format("largest ratio of viscosities {:g}", allowed_contrast(settings)));
  }
  return lines;
}

Forecast FillingProcess::forecast() const {
  return forecast_filling(scene_, way_, stride(), flow_ != nullptr, mixture_->is_linear());
}

std::vector<std::string> FillingProcess::output_fields() const {
  std::vector<std::string> names = {"velocity", "pressure", "viscosity", "strain_rate"};
  if (flow_) names.insert(names.end(), {"shear_rate", "wall_shear_stress"});
  for (const std::string& name : fronts_.names()) names.push_back(name);
  names.emplace_back("fill_time");
  if (front_) names.emplace_back("weld_angle");
  if (scene_.fields.has("arrival_time")) names.emplace_back("arrival_time");
  if (has_gas()) names.emplace_back("air_pressure");
  return names;
}

void FillingProcess::refresh_outputs() {
  if (flow_) {
    const std::span<const Real> strain_rate = scene_.fields["strain_rate"].values();
    const std::span<Real> shear_rate = scene_.fields["shear_rate"].values();
    for (std::size_t e = 0; e < shear_rate.size(); ++e) shear_rate[e] = std::sqrt(3.0) * strain_rate[e];
    scene_.fields["wall_shear_stress"].assign(wall_shear_stress(scene_));
  }
  if (front_) scene_.fields["weld_angle"].assign(weld_angle(scene_, scene_.fields["fill_time"].values()));
}

ErrorBudget FillingProcess::error_budget() {
  const InjectCase& settings = scene_.settings;
  ErrorClues clues;
  clues.has_front = has_fronts() && filling_ != nullptr;
  clues.solves_flow = flow_ != nullptr;
  clues.is_linear = mixture_->is_linear();
  clues.follows_distance = settings.flow.update.kind == FlowUpdate::Kind::automatic;
  clues.freezing_elements = flow_ ? flow_->freezing_error() : 0;
  clues.filled_since_flow = state_.filled > 0 ? std::abs(state_.filled - state_.filled_at_flow) / state_.filled : 0;
  clues.way_elements = way_ / scene_.element_size;
  clues.cfl = settings.front.cfl;
  clues.volume_error = filling_ ? filling_->volume_error() : 0;
  clues.newton_tolerance = settings.common.solver.newton_tolerance;
  clues.linear_tolerance = settings.common.solver.linear_tolerance;
  clues.thin = thin_;
  return error_sources(clues);
}

/// Elements that the front crosses in an increment: as many as the flow may lag behind.
Real FillingProcess::stride() const {
  const FlowSettings& flow = scene_.settings.flow;
  if (flow_ && flow.update.kind == FlowUpdate::Kind::every) return scene_.settings.front.cfl;
  if (flow_ && flow.update.kind == FlowUpdate::Kind::automatic) {
    return std::max(flow.update_distance, scene_.settings.front.cfl);
  }
  return scene_.settings.front.transport == FrontSettings::Transport::trace ? traced_stride : frozen_stride;
}

/// No more comes in than there is room for.
Real FillingProcess::largest_step() {
  if (!has_fronts()) return unlimited;
  const Real cfl = scene_.settings.front.cfl;
  Real elements = stride();
  const bool follows_front = flow_ && scene_.settings.flow.update.kind == FlowUpdate::Kind::automatic;
  // A vent that closes changes the flow at once.
  if (follows_front && fronts_.is_near_open_vent(elements * scene_.element_size)) {
    elements = std::max(elements / 2, cfl);
  }
  const Real rate = flow_ ? front_->crossing_rate() : front_->rate();
  Real dt = rate > 0 ? elements / rate : unlimited;
  if (flow_) dt = std::min(flow_->step_with_gates(dt), flow_->largest_step());
  const Real inflow = state_.inflow();
  if (inflow > 0 && filling_->unfilled() > 0) dt = std::min(dt, filling_->unfilled() / inflow);
  return dt;
}

std::optional<std::string> FillingProcess::finished() {
  return filling_ ? filling_->finished() : std::nullopt;
}

std::vector<std::string> FillingProcess::history_columns() const {
  std::vector<std::string> columns = {"fill_fraction", "injected_m3", "volume_error", "flow_updated"};
  for (const InletSettings& inlet : scene_.settings.inlets) {
    columns.push_back("pressure_" + inlet.name + "_Pa");
    columns.push_back("flow_" + inlet.name + "_m3_s");
  }
  if (flow_) {
    for (int c = 0; c < scene_.mesh.dim; ++c) columns.push_back(fmt::format("clamp_force_{}_N", "xyz"[c]));
  }
  if (has_gas()) columns.insert(columns.end(), {"trapped_air_m3", "trapped_air_Pa"});
  for (const std::string& name : error_columns()) columns.push_back(name);
  return columns;
}

bool FillingProcess::has_gas() const {
  return flow_ && flow_->void_model() != nullptr && flow_->void_model()->has_gas();
}

/// With [reference] at = every: the absolute errors, as summary.json names them.
std::vector<std::string> FillingProcess::error_columns() const {
  const auto& reference = scene_.settings.common.reference;
  if (!reference || reference->at != ReferenceTime::every) return {};
  std::vector<std::string> names;
  if (reference->velocity[0]) names.insert(names.end(), {"velocity_l2", "velocity_h1"});
  if (reference->pressure && flow_) names.emplace_back("pressure_l2");
  if (reference->level_set && fronts_.size() == 1) names.emplace_back("level_set_l1");
  return names;
}

std::vector<HistoryCell> FillingProcess::history_row() {
  std::vector<HistoryCell> row = {filling_ ? filling_->fill_fraction() : 1, state_.injected,
                                  filling_ ? filling_->volume_error() : 0, flow_ && state_.flow_updated ? 1 : 0};
  for (const GateState& gate : state_.gates) {
    row.push_back(flow_ ? HistoryCell(gate.pressure) : HistoryCell());
    row.push_back(gate.flow);
  }
  if (flow_) {
    const std::array<Real, 3> force = opening_force(scene_);
    row.insert(row.end(), force.begin(), force.begin() + scene_.mesh.dim);
  }
  if (has_gas()) {
    const std::array<Real, 2> gas = flow_->void_model()->trapped_gas();
    row.insert(row.end(), {gas[0], gas[1]});
  }
  const std::vector<std::string> errors = error_columns();
  if (errors.empty()) return row;
  const nlohmann::json known = known_errors();
  for (const std::string& name : errors)
    row.push_back(known.contains(name) ? HistoryCell(known.at(name)) : HistoryCell());
  return row;
}

/// The pressures of gates whose flow is given, else the flows through the others; in their absence the power of the
/// flow.
std::vector<Real> FillingProcess::results() {
  if (!flow_) return {};
  std::vector<Real> pressures;
  std::vector<Real> flows;
  for (const GateState& gate : state_.gates) {
    if (gate.drive.kind != GateDrive::Kind::pressure) pressures.push_back(gate.pressure);
    flows.push_back(gate.flow);
  }
  if (!pressures.empty()) return pressures;
  if (!flows.empty()) return flows;
  const auto rate = scene_.fields["strain_rate"].values();
  const auto viscosity = scene_.fields["viscosity"].values();
  Real power = 0;
  for (std::size_t e = 0; e < rate.size(); ++e) power += 3 * viscosity[e] * rate[e] * rate[e] * scene_.measures[e];
  power = scene_.comm.sum(power);
  return power > share_of_rest * power_of_pressures() ? std::vector<Real>{power} : std::vector<Real>{};
}

/// Power [W] that the pressures' differences would have on the fastest flow through the cavity: what stirs in a fluid
/// at rest, by the tolerance of the solver, is nothing beside it.
Real FillingProcess::power_of_pressures() const {
  Real low = unlimited;
  Real high = -unlimited;
  for (const Real value : scene_.fields["pressure"].values()) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  Real speed = 0;
  for (const Real value : scene_.fields["velocity"].values()) speed = std::max(speed, std::abs(value));
  const Real difference = scene_.comm.max(high) + scene_.comm.max(-low);
  const Real section = std::pow(scene_.cavity, 1 - 1.0 / scene_.mesh.dim);
  return difference * scene_.comm.max(speed) * section;
}

void FillingProcess::solve_all_next() {
  if (flow_) flow_->solve_next();
}

bool FillingProcess::solves_again() const {
  return flow_ && scene_.settings.flow.update.kind != FlowUpdate::Kind::once;
}

std::string FillingProcess::increment_note() const {
  if (!has_fronts()) return "flow solved";
  return fmt::format("filled {:.4f}{} | {} substeps", filling_->fill_fraction(),
                     state_.flow_updated ? " | flow solved" : "", front_->substeps());
}

LinearTotals FillingProcess::linear_totals() const {
  return flow_ ? flow_->linear_totals() : LinearTotals{};
}

nlohmann::json FillingProcess::known_errors() {
  const ReferenceSettings& reference = *scene_.settings.common.reference;
  DiscreteFields fields;
  fields.velocity = scene_.fields["velocity"].values();
  if (flow_) {
    fields.pressure = scene_.fields["pressure"].values();
    fields.pressure_is_free = flow_->pressure_is_free();
  }
  if (fronts_.size() == 1) fields.level_set = fronts_.values(0);
  const SolutionErrors errors =
      solution_errors(scene_.comm, scene_.mesh, scene_.geometry,
                      {reference.velocity, reference.pressure, reference.level_set}, fields, {}, state_.time);
  nlohmann::json json = nlohmann::json::object();
  const auto put = [&](const std::string& name, const std::optional<ErrorNorm>& norm) {
    if (!norm) return;
    json[name] = norm->absolute;
    json[name + "_relative"] = norm->known > 0 ? nlohmann::json(norm->relative()) : nlohmann::json();
  };
  put("velocity_l2", errors.velocity_l2);
  put("velocity_h1", errors.velocity_h1);
  put("pressure_l2", errors.pressure_l2);
  put("level_set_l1", errors.level_set_l1);
  return json;
}

nlohmann::json FillingProcess::accuracy() {
  nlohmann::json json = nlohmann::json::object();
  json["volume_error"] = filling_ ? filling_->volume_error() : 0;
  if (filling_) {
    json["trapped_air"] = nlohmann::json::array();
    for (const AirPocket& pocket : filling_->trapped_air()) {
      json["trapped_air"].push_back({{"volume_m3", pocket.volume}, {"place_m", pocket.place}});
    }
  }
  if (flow_) json["flow_freezing_error_elements"] = flow_->freezing_error();
  json["share_below_4_elements_across"] = thin_.below_four;
  json["share_below_2_elements_across"] = thin_.below_two;
  if (scene_.settings.common.reference) json["errors"] = known_errors();
  return json;
}

std::vector<std::string> FillingProcess::closing_lines() {
  std::vector<std::string> lines;
  if (!has_fronts()) return lines;
  lines.push_back(
      fmt::format("filled {:.4f} of the cavity; {} flow solves, {} redistances; left through vents {:.4g} m^3",
                  filling_->fill_fraction(), state_.flow_solves, front_->redistances(), state_.left));
  if (front_->pockets_filled() > 0) {
    lines.push_back(fmt::format("{} pockets of air too small for the mesh were filled", front_->pockets_filled()));
  }
  constexpr std::size_t most_lines = 5;
  const std::vector<AirPocket> trapped = filling_->trapped_air();
  for (std::size_t k = 0; k < std::min(most_lines, trapped.size()); ++k) {
    const auto& place = trapped[k].place;
    lines.push_back(fmt::format("air trap: {:.4g} m^3 around ({:.4g}, {:.4g}, {:.4g}) m", trapped[k].volume, place[0],
                                place[1], place[2]));
  }
  if (trapped.size() > most_lines)
    lines.push_back(fmt::format("and {} smaller air traps", trapped.size() - most_lines));
  if (flow_) {
    lines.push_back(state_.flow_solves > 1
                        ? fmt::format("keeping the flow between solves moved the front by {:.2g} elements in all",
                                      flow_->freezing_error())
                        : "the flow was solved once: how far keeping it moved the front is not known");
  }
  return lines;
}

nlohmann::json FillingProcess::save_state() const {
  nlohmann::json gates = nlohmann::json::array();
  for (const GateState& gate : state_.gates) {
    gates.push_back({{"kind", static_cast<int>(gate.drive.kind)},
                     {"value", gate.drive.value},
                     {"pressure", gate.pressure},
                     {"flow", gate.flow},
                     {"switched", gate.switched}});
  }
  nlohmann::json state = {{"gates", gates},
                          {"time", state_.time},
                          {"initial", state_.initial},
                          {"injected", state_.injected},
                          {"left", state_.left},
                          {"filled", state_.filled},
                          {"filled_at_flow", state_.filled_at_flow},
                          {"travelled", state_.travelled},
                          {"seals", fronts_.seals()},
                          {"flow_solves", state_.flow_solves},
                          {"increments_since_flow", state_.increments_since_flow},
                          {"seconds_since_flow", state_.seconds_since_flow}};
  if (flow_) state["flow"] = flow_->save();
  if (front_) state["front"] = front_->save();
  if (remeshing_) state["remeshing"] = remeshing_->save();
  if (rebalancing_) state["balance"] = rebalancing_->save();
  return state;
}

void FillingProcess::restore(Mesh&& mesh, std::vector<std::pair<FieldSpec, std::vector<Real>>>&& fields,
                             const nlohmann::json& state) {
  scene_.mesh = std::move(mesh);
  for (auto& [spec, values] : fields) scene_.fields.declare(scene_.mesh, spec).assign(std::move(values));
  scene_.rebuild();
  const nlohmann::json& gates = state.at("gates");
  for (std::size_t i = 0; i < state_.gates.size(); ++i) {
    GateState& gate = state_.gates[i];
    gate.drive = {static_cast<GateDrive::Kind>(gates[i].at("kind").get<int>()), gates[i].at("value")};
    gate.pressure = gates[i].at("pressure");
    gate.flow = gates[i].at("flow");
    gate.switched = gates[i].at("switched");
  }
  state_.time = state.at("time");
  state_.initial = state.at("initial");
  state_.injected = state.at("injected");
  state_.left = state.at("left");
  state_.filled = state.at("filled");
  state_.filled_at_flow = state.at("filled_at_flow");
  state_.travelled = state.at("travelled");
  fronts_.set_seals(state.at("seals").get<std::vector<char>>());
  state_.flow_solves = state.at("flow_solves");
  state_.increments_since_flow = state.at("increments_since_flow");
  state_.seconds_since_flow = state.at("seconds_since_flow");
  if (flow_) {
    flow_->rebuild();
    flow_->load(state.at("flow"));
  }
  if (front_) {
    front_->rebuild();
    front_->load(state.at("front"));
  }
  if (remeshing_ && state.contains("remeshing")) remeshing_->restore(state.at("remeshing"));
  if (rebalancing_ && state.contains("balance")) rebalancing_->restore(state.at("balance"));
}

}  // namespace malleus::inject
