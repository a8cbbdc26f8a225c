#include "forge/forge_process.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "forge/contact_couplings.hpp"
#include "forge/forge_budget.hpp"
#include "forge/push_out.hpp"
#include "forge/state_json.hpp"
#include "mesh/simplex.hpp"

namespace malleus::forge {
namespace {

/// A run that a stroke ends is over after so many increments in which the stroke did not advance.
constexpr int most_at_rest = 200;
constexpr Real no_limit = std::numeric_limits<Real>::infinity();

/// Whether an output or a probe shows the field.
bool is_recorded(const CommonSections& common, const std::string& field) {
  const auto shows = [&](const std::vector<std::string>& names) {
    return names.empty() || std::find(names.begin(), names.end(), field) != names.end();
  };
  return shows(common.output.fields) || std::any_of(common.probes.begin(), common.probes.end(),
                                                    [&](const ProbeSettings& probe) { return shows(probe.fields); });
}

}  // namespace

ForgeProcess::ForgeProcess(const ForgeCase& forge_case, std::unique_ptr<Scene> scene)
    : case_(forge_case), scene_(std::move(scene)), flow_(*scene_), folds_(*scene_), motion_(*scene_, flow_) {
  if (case_.common.remesh && case_.common.remesh->active) remeshing_.emplace(*case_.common.remesh, remeshed_scene());
  if (Rebalancing::is_wanted(case_.common.partition, *scene_->comm))
    rebalancing_.emplace(case_.common.partition, rebalanced_scene());
  flow_.set_keeps_stress(is_recorded(case_.common, field_name::stress));
  if (case_.common.reference) errors_.emplace(*scene_, flow_, *case_.common.reference);
  if (scene_->thermal) heat_.emplace(*scene_, flow_);
  if (case_.common.probes.empty()) return;
  probes_.emplace(*scene_->comm, scene_->mesh, case_.common.probes);
  if (probes_->any_moves()) tracers_.emplace(*probes_, scene_->mesh, scene_->fields);
}

std::vector<Component*> ForgeProcess::components() {
  std::vector<Component*> list;
  if (remeshing_) list.push_back(&*remeshing_);
  if (rebalancing_) list.push_back(&*rebalancing_);
  list.push_back(&flow_);
  if (errors_) list.push_back(&*errors_);
  if (tracers_) list.push_back(&*tracers_);
  if (heat_) list.push_back(&*heat_);
  list.push_back(&motion_);
  return list;
}

RebalancedScene ForgeProcess::rebalanced_scene() {
  const auto mesh_moved = [this] {
    scene_->boundaries->mesh_changed();
    flow_.mesh_changed();
  };
  return {scene_->comm, &scene_->mesh, &scene_->fields, mesh_moved, [this] { return contact_couplings(*scene_); }};
}

RemeshedScene ForgeProcess::remeshed_scene() {
  RemeshedScene lent;
  lent.comm = scene_->comm;
  lent.mesh = &scene_->mesh;
  lent.fields = &scene_->fields;
  lent.flow_field = field_name::velocity;
  lent.balances_by_cost = case_.common.partition.method != PartitionMethod::curve;
  lent.keep_volume = true;
  for (const Body& body : scene_->bodies) {
    const auto settings = std::find_if(case_.bodies.begin(), case_.bodies.end(),
                                       [&](const BodySettings& one) { return one.name == body.name; });
    const bool stays = settings != case_.bodies.end() && !settings->remesh;
    lent.kept_regions.push_back(body.is_deformable() && !stays ? 0 : 1);
  }
  lent.mesh_changed = [this] { mesh_changed(); };
  lent.made_anew = [this] {
    scene_->boundaries->mesh_changed();
    push_out_of_tools(*scene_);
  };
  return lent;
}

/// A remesh moves free surfaces within their curvature and ends the history of the time scheme.
void ForgeProcess::mesh_changed() {
  scene_->boundaries->mesh_changed();
  flow_.remeshed();
  scene_->progress.last_step = 0;
  const std::vector<Real> volumes = body_volumes(*scene_);
  for (std::size_t i = 0; i < scene_->bodies.size(); ++i) scene_->bodies[i].volume = volumes[i];
}

std::vector<LeftOut> ForgeProcess::left_out() const {
  std::vector<LeftOut> list;
  if (scene_->tools.empty()) list.push_back({"rigid tools", "no [tool.NAME] section"});
  if (scene_->pairs.empty()) list.push_back({"contact between bodies", "no [contact.NAME] section"});
  if (!case_.common.thermal) list.push_back({"heat equation", "no [thermal] section"});
  if (!case_.common.inertia) list.push_back({"inertia", "no [inertia] section"});
  if (!case_.common.gravity) list.push_back({"gravity", "no [gravity] section"});
  if (!remeshing_) list.push_back({"remeshing", case_.common.remesh ? "[remesh] active = no" : "no [remesh] section"});
  for (const Body& body : scene_->bodies) {
    if (!body.is_deformable()) list.push_back({"deformation of " + body.name, "law = rigid: no unknowns"});
  }
  return list;
}

/// Dies so much stiffer than what they press that their own deformation changes the forces by less than a tenth of a
/// per cent (cases/press: 100 times as stiff, 4e-5).
std::vector<std::string> ForgeProcess::accuracy_settings() const {
  return {fmt::format("newton_tolerance {:g}, linear_tolerance {:g}, cutoff_strain_rate {:g} of {:.3g} 1/s",
                      scene_->solver.newton_tolerance, scene_->solver.linear_tolerance,
                      scene_->solver.cutoff_strain_rate, scene_->scale.rate()),
          fmt::format("penalty {:g}{}, slip_scale {:g}", scene_->penalty.penalty,
                      scene_->penalty.augmented ? " augmented" : "", scene_->penalty.slip_scale),
          fmt::format("largest change of an edge in a step {:g}{}", scene_->motion.edge_share,
                      std::isfinite(planned_strain()) ? fmt::format(", largest strain {:g}", planned_strain()) : "")};
}

Forecast ForgeProcess::forecast() const {
  // Measured on small scenes: seconds per node and Newton iteration, iterations an increment, bytes per node.
  constexpr Real seconds_per_node = 4e-5;
  constexpr Real iterations = 4;
  constexpr Real bytes_per_node = 12e3;
  Forecast forecast;
  const auto nodes = static_cast<Real>(scene_->mesh.total_nodes());
  Real step = std::min(case_.time.step.value_or(no_limit), planned_strain() / scene_->scale.rate());
  step = std::min(step, scene_->motion.edge_share / scene_->scale.rate());
  Real count = case_.time.increments ? *case_.time.increments : no_limit;
  if (case_.time.end) count = std::min(count, std::ceil(*case_.time.end / step));
  if (case_.time.stroke) count = std::min(count, std::ceil(*case_.time.stroke / (scene_->scale.speed * step)));
  forecast.increments = static_cast<GlobalId>(std::min(count, 1e9));
  forecast.wall_s = count * nodes * iterations * seconds_per_node / scene_->comm->size();
  forecast.memory_bytes = nodes * bytes_per_node + 6e7 * scene_->comm->size();
  return forecast;
}

std::vector<std::string> ForgeProcess::output_fields() const {
  std::vector<std::string> names;
  for (const Field* field : std::as_const(scene_->fields).all()) names.push_back(field->spec().name);
  return names;
}

/// The largest strain in a step, where the case does not leave steps to [time] step.
Real ForgeProcess::planned_strain() const {
  if (case_.motion.strain) return *case_.motion.strain;
  if (case_.time.step) return no_limit;
  constexpr std::array<Real, n_levels> by_level = {0.03, 0.015, 0.007, 0.0035};
  return by_level[static_cast<std::size_t>(case_.common.accuracy.level)];
}

/// The step in which the schemes' error of third order keeps the volume to a share by level, by the last step's loss.
Real ForgeProcess::volume_step() const {
  constexpr std::array<Real, n_levels> by_level = {3e-3, 1e-3, 3e-4, 1e-4};
  const Real share = by_level[static_cast<std::size_t>(case_.common.accuracy.level)];
  const Progress& progress = scene_->progress;
  if (scene_->motion.scheme == TimeScheme::euler || !(progress.last_step > 0)) return no_limit;
  Real step = no_limit;
  for (const Real loss : progress.volume_losses) {
    if (loss != 0) step = std::min(step, progress.last_step * std::cbrt(share / std::abs(loss)));
  }
  return step;
}

Real ForgeProcess::largest_step() {
  const Real edge_rate = flow_.largest_edge_rate() > 0 ? flow_.largest_edge_rate() : scene_->scale.rate();
  const Real strain_rate = flow_.largest_strain_rate() > 0 ? flow_.largest_strain_rate() : scene_->scale.rate();
  Real step = std::min({scene_->motion.edge_share / edge_rate, planned_strain() / strain_rate, volume_step()});
  for (const Tool& tool : scene_->tools) {
    step = std::min(step, tool.press().step_limit(tool.press().state().last_force));
  }
  if (case_.time.stroke && leading_stroke()) {
    const Real remaining = *case_.time.stroke - *leading_stroke();
    const Real speed = leading_speed();
    if (speed > 0) step = std::min(step, std::max(remaining, 1e-6 * *case_.time.stroke) / speed);
  }
  if (!scene_->progress.was_pushed && !scene_->boundaries->has_loads() &&
      !(scene_->boundaries->largest_speed(scene_->progress.time) > 0)) {
    const Real free = flow_.time_to_touch(scene_->progress.time);
    // Where nothing will ever touch only heat goes on, and [time] says in which steps.
    const Real idle = heat_ ? no_limit : step;
    if (free > 0) step = std::min(case_.time.step.value_or(no_limit), std::isfinite(free) ? free : idle);
  }
  return step;
}

std::optional<Real> ForgeProcess::leading_stroke() const {
  for (const Tool& tool : scene_->tools) {
    if (tool.motion().direction.squaredNorm() > 0) return std::abs(tool.press().state().stroke);
  }
  for (std::size_t i = 0; i < scene_->boundaries->settings().size(); ++i) {
    const auto mean = scene_->boundaries->mean_velocity(i, scene_->progress.time);
    if (to_vector(mean.data(), 3).norm() > 0 || scene_->progress.boundary_strokes[i] > 0) {
      return scene_->progress.boundary_strokes[i];
    }
  }
  return std::nullopt;
}

Real ForgeProcess::leading_speed() const {
  for (const Tool& tool : scene_->tools) {
    if (tool.motion().direction.squaredNorm() > 0) return std::abs(tool.press().speed(scene_->progress.time));
  }
  for (std::size_t i = 0; i < scene_->boundaries->settings().size(); ++i) {
    const auto mean = scene_->boundaries->mean_velocity(i, scene_->progress.time);
    const Real speed = to_vector(mean.data(), 3).norm();
    if (speed > 0) return speed;
  }
  return 0;
}

/// Where the stroke alone ends the run: why it will not be reached.
std::optional<std::string> ForgeProcess::stalled() const {
  if (!case_.time.stroke || case_.time.end || case_.time.increments) return std::nullopt;
  const Real stroke = leading_stroke().value_or(0);
  for (const Tool& tool : scene_->tools) {
    if (!(tool.motion().direction.squaredNorm() > 0)) continue;
    if (tool.press().is_stalled(scene_->progress.time)) {
      return fmt::format("the press of {} stalled at its force limit, after {:.6g} m of the stroke", tool.name(),
                         stroke);
    }
    break;
  }
  if (at_rest_ >= most_at_rest) {
    return fmt::format("nothing advanced in {} increments, after {:.6g} m of the stroke", at_rest_, stroke);
  }
  return std::nullopt;
}

std::optional<std::string> ForgeProcess::finished() {
  if (case_.time.stroke && leading_stroke().value_or(0) >= *case_.time.stroke * (1 - 1e-9)) return "stroke reached";
  if (const auto why = stalled()) return why;
  bool all_stopped = !scene_->tools.empty() && !(scene_->boundaries->largest_speed(scene_->progress.time) > 0);
  for (const Tool& tool : scene_->tools) {
    if (tool.moves()) all_stopped = all_stopped && tool.press().state().stopped;
  }
  bool any_moves = false;
  for (const Tool& tool : scene_->tools) any_moves = any_moves || tool.moves();
  if (any_moves && all_stopped) return "the presses came to rest";
  return std::nullopt;
}

void ForgeProcess::refresh_outputs() {
  const Mesh& mesh = scene_->mesh;
  auto quality = scene_->fields[field_name::quality].values();
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      quality[i] = simplex_quality<D>(simplex_points<D>(mesh, e));
    }
  });
}

std::vector<ForgeProcess::Opponent> ForgeProcess::opponents() const {
  std::vector<Opponent> list;
  for (std::size_t t = 0; t < scene_->tools.size(); ++t) {
    list.push_back({Opponent::Kind::tool, t, scene_->tools[t].name()});
  }
  const auto is_new = [&](const std::string& name) {
    return std::none_of(list.begin(), list.end(), [&](const Opponent& one) { return one.name == name; });
  };
  for (const BodyPair& pair : scene_->pairs) {
    const std::string& name = scene_->bodies[static_cast<std::size_t>(pair.master)].name;
    if (is_new(name)) list.push_back({Opponent::Kind::body, static_cast<std::size_t>(pair.master), name});
  }
  for (std::size_t i = 0; i < scene_->boundaries->settings().size(); ++i) {
    const BoundarySettings& boundary = scene_->boundaries->settings()[i];
    if (boundary.has_velocity() && is_new(boundary.name)) list.push_back({Opponent::Kind::boundary, i, boundary.name});
  }
  return list;
}

Vector ForgeProcess::force_on(const Opponent& opponent) const {
  const FlowReport& report = flow_.report();
  const std::vector<Vector>& forces = opponent.kind == Opponent::Kind::tool   ? report.tool_forces
                                      : opponent.kind == Opponent::Kind::body ? report.body_forces
                                                                              : report.boundary_forces;
  return opponent.index < forces.size() ? forces[opponent.index] : Vector(Vector::Zero());
}

Real ForgeProcess::stroke_of(const Opponent& opponent) const {
  switch (opponent.kind) {
    case Opponent::Kind::tool:
      return scene_->tools[opponent.index].press().state().stroke;
    case Opponent::Kind::body:
      return scene_->progress.body_strokes[opponent.index];
    case Opponent::Kind::boundary:
      return scene_->progress.boundary_strokes[opponent.index];
  }
  return 0;
}

std::vector<std::string> ForgeProcess::history_columns() const {
  std::vector<std::string> columns = {"newton_iterations", "volume_change", "min_quality", "max_penetration_m",
                                      "remeshed"};
  for (const Opponent& one : opponents()) {
    for (int c = 0; c < scene_->dim(); ++c) columns.push_back(fmt::format("force_{}_{}_N", one.name, "xyz"[c]));
    columns.push_back(fmt::format("stroke_{}_m", one.name));
    if (one.kind != Opponent::Kind::boundary) columns.push_back(fmt::format("contact_area_{}_m2", one.name));
    if (has_filling(one)) columns.push_back(fmt::format("filling_{}", one.name));
  }
  columns.emplace_back("folds");
  if (heat_) {
    for (const Body& body : scene_->bodies) columns.push_back(fmt::format("temperature_{}_K", body.name));
    for (const char* name : {"min_temperature_K", "max_temperature_K"}) columns.emplace_back(name);
  }
  if (errors_) {
    for (std::string& name : errors_->columns()) columns.push_back(std::move(name));
  }
  return columns;
}

std::vector<HistoryCell> ForgeProcess::history_row() {
  const FlowReport& report = flow_.report();
  const Real stroke = leading_stroke().value_or(0);
  at_rest_ = stroke != last_stroke_ ? 0 : at_rest_ + 1;
  last_stroke_ = stroke;
  sum_up_increment();
  max_penetration_ = std::max(max_penetration_, report.max_penetration);
  max_imbalance_ = std::max(max_imbalance_, report.force_imbalance);
  newton_total_ += report.newton_iterations;
  ++increments_;
  std::vector<HistoryCell> row = {static_cast<Real>(report.newton_iterations), volume_change(),
                                  smallest_quality(*scene_), report.max_penetration,
                                  remeshing_ && remeshing_->remeshed() ? 1.0 : 0.0};
  for (const Opponent& one : opponents()) {
    const Vector force = force_on(one);
    for (int c = 0; c < scene_->dim(); ++c) row.emplace_back(force[c]);
    row.emplace_back(stroke_of(one));
    for (const HistoryCell& cell : contact_cells(one)) row.push_back(cell);
  }
  row.emplace_back(static_cast<Real>(folds_.folds().size()));
  if (heat_) {
    for (const Real temperature : body_temperatures(*scene_)) row.emplace_back(temperature);
  }
  if (errors_ && !errors_->columns().empty()) {
    const nlohmann::json& errors = errors_->errors();
    for (const std::string& name : errors_->columns()) row.emplace_back(Real(errors.at(name)));
  }
  return row;
}

bool ForgeProcess::has_filling(const Opponent& opponent) const {
  return opponent.kind == Opponent::Kind::tool && scene_->tools[opponent.index].area(false) > 0;
}

/// Area in contact, and of a tool with a surface file the share of its surface.
std::vector<HistoryCell> ForgeProcess::contact_cells(const Opponent& opponent) const {
  if (opponent.kind == Opponent::Kind::boundary) return {};
  const std::vector<Real>& areas = flow_.report().contact_areas;
  Real area = 0;
  if (opponent.kind == Opponent::Kind::tool && opponent.index < areas.size()) area = areas[opponent.index];
  for (std::size_t i = 0; opponent.kind == Opponent::Kind::body && i < scene_->pairs.size(); ++i) {
    const std::size_t at = scene_->tools.size() + i;
    const bool is_master = static_cast<std::size_t>(scene_->pairs[i].master) == opponent.index;
    if (is_master && at < areas.size()) area += areas[at];
  }
  std::vector<HistoryCell> cells = {area};
  if (has_filling(opponent)) {
    cells.emplace_back(area / scene_->tools[opponent.index].area(scene_->geometry == Geometry::axisymmetric));
  }
  return cells;
}

/// Mean over the deformable bodies by volume, 1/s. Collective.
Real ForgeProcess::mean_strain_rate() const {
  const Mesh& mesh = scene_->mesh;
  const auto rates = std::as_const(scene_->fields)[field_name::strain_rate].values();
  std::array<Real, 2> sums = {0, 0};
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      if (!scene_->bodies[static_cast<std::size_t>(mesh.element_region[i])].is_deformable()) continue;
      const Real volume = simplex_volume<D>(simplex_points<D>(mesh, e));
      sums[0] += volume * rates[i];
      sums[1] += volume;
    }
  });
  scene_->comm->sum_in_place(sums);
  return sums[1] > 0 ? sums[0] / sums[1] : 0;
}

/// What an increment adds to the sums of the run.
void ForgeProcess::sum_up_increment() {
  const Real dt = scene_->progress.time - last_time_;
  if (dt > 0 && scene_->progress.was_pushed) force_errors_.add(increment_errors(*scene_, flow_.report(), dt));
  last_time_ = scene_->progress.time;
  const WorkBalance& power = flow_.report().power;
  work_.imposed += dt * power.imposed;
  work_.tools += dt * power.tools;
  work_.deformation += dt * power.deformation;
  work_.contact += dt * power.contact;
  largest_strain_step_ = std::max(largest_strain_step_, dt * mean_strain_rate());
  folds_.look(scene_->progress.time, flow_.touching());
}

/// Penalties go with 1/size: those of the other mesh.
void ForgeProcess::stand_as_it_is(Real size_ratio) {
  scene_->contact.penalty *= size_ratio;
  scene_->contact.closes_gaps = false;
  scene_->motion.volume_target = VolumeTarget::no;
}

ErrorBudget ForgeProcess::error_budget() {
  RunMeasures run;
  run.largest_strain_step = largest_strain_step_;
  run.volume_change = volume_change();
  run.raw_volume_drift = scene_->progress.raw_volume_drift;
  run.forces = force_errors_.mean();
  run.max_penetration = max_penetration_;
  run.travel = std::max(leading_stroke().value_or(0), scene_->scale.speed * scene_->progress.time);
  run.gives_step = case_.time.step.has_value();
  return forge_error_budget(*scene_, run);
}

Real ForgeProcess::volume() const {
  Real sum = 0;
  for (const Body& body : scene_->bodies) sum += body.volume;
  return sum;
}

Real ForgeProcess::volume_change() const {
  Real start = 0;
  for (const Body& body : scene_->bodies) start += body.is_deformable() ? body.start_volume : 0;
  return start > 0 ? scene_->deformable_volume() / start - 1 : 0;
}

/// The forces on tools, masters and driven boundaries [N].
std::vector<Real> ForgeProcess::results() {
  std::vector<Real> forces;
  for (const Opponent& one : opponents()) forces.push_back(force_on(one).norm());
  return forces;
}

std::string ForgeProcess::increment_note() const {
  const FlowReport& report = flow_.report();
  std::string note = fmt::format("newton {}", report.newton_iterations);
  if (report.midpoint_iterations > 0) note += fmt::format("+{}", report.midpoint_iterations);
  note += fmt::format(", volume {:+.1e}", volume_change());
  for (const Opponent& one : opponents()) note += fmt::format(", F {} {:.4g} N", one.name, force_on(one).norm());
  return note;
}

LinearTotals ForgeProcess::linear_totals() const {
  const FlowTotals& totals = flow_.totals();
  return {totals.linear_solves,    totals.linear_iterations, totals.linear_failures,
          totals.assembly_seconds, totals.setup_seconds,     totals.solve_seconds};
}

nlohmann::json ForgeProcess::accuracy() {
  nlohmann::json json = {{"volume_change", volume_change()},
                         {"raw_volume_drift", scene_->progress.raw_volume_drift},
                         {"max_penetration_m", max_penetration_},
                         {"force_imbalance", max_imbalance_},
                         {"newton_iterations", newton_total_}};
  json["work"] = work_json(work_);
  if (!scene_->boundaries->has_loads()) {
    const Real given = work_.imposed + work_.tools;
    json["work"]["imbalance"] = given != 0 ? (given - work_.deformation - work_.contact) / std::abs(given) : 0;
  }
  json["folds"] = folds_.save();
  if (heat_) json["heat"] = heat_json(heat_->totals());
  if (errors_) json["errors"] = errors_->errors();
  return json;
}

std::vector<std::string> ForgeProcess::closing_lines() {
  return {
      fmt::format("volume {:+.2e} (without targets {:+.2e}); deepest penetration {:.2e} m; forces balance to {:.1e}",
                  volume_change(), scene_->progress.raw_volume_drift, max_penetration_, max_imbalance_)};
}

nlohmann::json ForgeProcess::save_state() const {
  const Progress& progress = scene_->progress;
  nlohmann::json state = {{"time", progress.time},
                          {"last_step", progress.last_step},
                          {"raw_volume_drift", progress.raw_volume_drift},
                          {"was_pushed", progress.was_pushed},
                          {"boundary_strokes", progress.boundary_strokes},
                          {"body_strokes", progress.body_strokes},
                          {"volume_targets", progress.volume_targets},
                          {"volume_losses", progress.volume_losses},
                          {"max_penetration", max_penetration_},
                          {"max_imbalance", max_imbalance_},
                          {"newton_total", newton_total_},
                          {"edge_rate", flow_.largest_edge_rate()},
                          {"strain_rate", flow_.largest_strain_rate()}};
  if (remeshing_) state["remeshing"] = remeshing_->save();
  if (heat_) state["heat"] = heat_json(heat_->totals());
  if (rebalancing_) state["balance"] = rebalancing_->save();
  state["work"] = work_json(work_);
  state["folds"] = folds_.save();
  state["largest_strain_step"] = largest_strain_step_;
  state["force_errors"] = force_errors_.save();
  for (const Body& body : scene_->bodies) state["start_volumes"].push_back(body.start_volume);
  for (const Tool& tool : scene_->tools) state["presses"].push_back(press_json(tool.press().state()));
  return state;
}

void ForgeProcess::restore(Mesh&& mesh, std::vector<std::pair<FieldSpec, std::vector<Real>>>&& fields,
                           const nlohmann::json& state) {
  scene_->mesh = std::move(mesh);
  for (Field* field : scene_->fields.all()) {
    field->assign(std::vector<Real>(FieldStore::entities(scene_->mesh, field->spec().support) *
                                    static_cast<std::size_t>(field->components())));
  }
  for (auto& [spec, values] : fields) scene_->fields.declare(scene_->mesh, spec).assign(std::move(values));
  Progress& progress = scene_->progress;
  progress.time = state.at("time");
  progress.last_step = state.at("last_step");
  progress.raw_volume_drift = state.at("raw_volume_drift");
  progress.was_pushed = state.at("was_pushed");
  progress.boundary_strokes = state.at("boundary_strokes").get<std::vector<Real>>();
  progress.body_strokes = state.at("body_strokes").get<std::vector<Real>>();
  progress.volume_targets = state.at("volume_targets").get<std::vector<Real>>();
  progress.volume_losses = state.at("volume_losses").get<std::vector<Real>>();
  max_penetration_ = state.at("max_penetration");
  max_imbalance_ = state.at("max_imbalance");
  newton_total_ = state.at("newton_total");
  scene_->boundaries->mesh_changed();
  flow_.mesh_changed();
  flow_.set_rates(state.at("edge_rate"), state.at("strain_rate"));
  if (remeshing_ && state.contains("remeshing")) remeshing_->restore(state.at("remeshing"));
  work_ = work_of(state.at("work"));
  folds_.restore(state.at("folds"));
  largest_strain_step_ = state.at("largest_strain_step");
  force_errors_.restore(state.at("force_errors"));
  last_time_ = progress.time;
  if (heat_ && state.contains("heat")) heat_->set_totals(heat_totals(state.at("heat")));
  if (rebalancing_ && state.contains("balance")) rebalancing_->restore(state.at("balance"));
  const std::vector<Real> volumes = body_volumes(*scene_);
  for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
    scene_->bodies[i].start_volume = state.at("start_volumes").at(i);
    scene_->bodies[i].volume = volumes[i];
  }
  for (std::size_t t = 0; t < scene_->tools.size(); ++t) {
    scene_->tools[t].press().restore(press_state(state.at("presses").at(t)));
  }
}

}  // namespace malleus::forge
