#include "solvers/newton.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace malleus {

namespace {

/// Below this sensitivity Newton needs a start nearer to the solution than one linear solve gives.
constexpr Real picard_sensitivity = 0.3;
constexpr int picard_steps = 3;
/// Linear solves: gamma of Eisenstat and Walker's second choice (exponent 2).
constexpr Real forcing_factor = 0.9;
/// Linear problems: solves that bring the flow through the gates to the tolerance, and how far each goes.
constexpr int most_refinements = 4;
constexpr Real gate_refinement = 1e-2;
/// Of the linear tolerance, that the flow of a gate may be off, relative to what was asked.
constexpr Real gate_share = 0.3;
/// With inertia: the relative residual below which Newton's steps lead to the solution; Picard's do from anywhere.
constexpr Real near_with_inertia = 0.2;
/// A share of a step is taken where the potential's slope has fallen to this share of that at the start.
constexpr Real steepest_share = 0.5;

class Stopwatch {
 public:
  Real seconds() const { return std::chrono::duration<Real>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// One run of the loop: the state, its residual and the book-keeping.
class Loop {
 public:
  Loop(const NewtonOptions& options, StokesOperator& op, StokesLinearSolver& linear, StokesState& state)
      : options_(options), op_(op), linear_(linear), state_(state) {}

  NewtonOutcome run();

 private:
  void solve_linear_problem();
  void solve_nonlinear_problem();
  void evaluate();
  bool compute_step(bool newton, Real tolerance);
  bool search(bool newton);
  bool search_on_norm(bool newton);
  bool may_use_newton() const;
  Real power_at(const StokesState& start, Real share);
  Real cut_share(const StokesState& start, Real slope);
  Real forcing(Real previous_norm);
  Real loosest() const;
  bool is_near() const;
  bool is_cold() const { return options_.start_shear_rate > 0 || !options_.start_shear_rates.empty(); }
  void start_viscosity();
  Real sound_norm() const;
  void choose_branches(int iteration, bool cold);
  bool reached() const {
    return report_.norm <= options_.tolerance * report_.reference && report_.gate_error <= options_.tolerance;
  }
  void give_up(const std::string& reason);

  const NewtonOptions& options_;
  StokesOperator& op_;
  StokesLinearSolver& linear_;
  StokesState& state_;
  NewtonOutcome outcome_;
  LinearVector residual_;
  ResidualReport report_;
  LinearVector step_;
  Real forcing_ = loosest();
};

void Loop::evaluate() {
  const Stopwatch watch;
  op_.update_viscosity(state_);
  report_ = op_.residual(state_, residual_);
  outcome_.assembly_seconds += watch.seconds();
}

void Loop::start_viscosity() {
  if (options_.start_shear_rates.empty()) {
    op_.update_viscosity(options_.start_shear_rate);
  } else {
    op_.update_viscosity(options_.start_shear_rates);
  }
}

/// Solves for a step at the current residual. False where the linear solver failed.
bool Loop::compute_step(bool newton, Real tolerance) {
  const Stopwatch watch;
  const Tangent smooth = is_near() && !linear_.needs_symmetry() ? Tangent::newton : Tangent::symmetric;
  op_.use_matrix_free(linear_.is_matrix_free());
  const LinearSystem& system = op_.tangent(state_, newton ? smooth : Tangent::picard);
  outcome_.assembly_seconds += watch.seconds();
  LinearVector right_side = residual_;
  for (Real& value : right_side.nodes) value = -value;
  for (Real& value : right_side.borders) value = -value;
  step_ = {};
  const LinearOutcome solved = linear_.solve(system, right_side, tolerance, step_);
  ++outcome_.linear_solves;
  outcome_.linear_iterations += solved.iterations;
  outcome_.setup_seconds += solved.setup_seconds;
  outcome_.solve_seconds += solved.solve_seconds;
  outcome_.history.push_back({newton, report_.relative(), 0, solved.iterations, solved.residual});
  if (!solved.converged) give_up("the linear solver failed: " + solved.reason);
  return solved.converged;
}

void Loop::give_up(const std::string& reason) {
  outcome_.converged = false;
  outcome_.worst = op_.worst_node(residual_);
  const auto& place = outcome_.worst.place;
  outcome_.reason = fmt::format("{}; relative residual {:.3g} after {} iterations, worst at ({:.6g}, {:.6g}, {:.6g}) m",
                                reason, report_.relative(), outcome_.iterations(), place[0], place[1], place[2]);
}

void Loop::solve_linear_problem() {
  // The tolerance is relative to the right side of the problem from rest; a good first guess then saves iterations.
  StokesState rest = op_.start_state();
  LinearVector unused;
  op_.update_viscosity(rest);
  const Real whole = op_.residual(rest, unused).norm;
  op_.impose_constraints(state_);
  evaluate();
  const Real goal = options_.linear_tolerance * whole;
  // The norm says little of the gates, where a few nodes carry all that flows.
  const auto is_exact = [&] {
    return report_.norm <= goal && report_.gate_error <= gate_share * options_.linear_tolerance;
  };
  for (int pass = 0; pass < most_refinements && !is_exact(); ++pass) {
    const Real wanted = report_.norm > goal ? goal / report_.norm : gate_refinement;
    if (!compute_step(true, std::min(0.5, wanted))) return;
    op_.add_step(step_, 1, 1, state_);
    evaluate();
    outcome_.history.back().step = 1;
    outcome_.history.back().residual = report_.relative();
  }
  outcome_.converged = true;
}

/// The residual's norm, without what the penalties of a guess make beyond the forces within the bodies: those go with
/// the next linear solve, whatever it starts from.
Real Loop::sound_norm() const {
  return op_.has_terms() && report_.internal > 0 ? std::min(report_.norm, report_.internal) : report_.norm;
}

/// While the branches of the terms (which contacts hold) are still sought, each step is made with those of its start:
/// a smooth problem, whose line search does not stop where a contact closes. This is the active set method; the set of
/// a step is that of the whole last step, whatever share of it was taken. The terms bring a first set, as
/// the velocities of a guess say less of pressures than that does. Later each evaluation has its own branches, and the
/// search on the convex potential ends any cycle.
void Loop::choose_branches(int iteration, bool cold) {
  if (!op_.has_terms() || iteration >= options_.set_iterations) return;
  op_.choose_branches(Branches::carry, state_);
  if (iteration == 0 && cold) {
    report_ = op_.residual(state_, residual_);  // at the viscosities of the start
  } else {
    evaluate();
  }
}

/// Whether the derivative of the subscales helps. Far away it throws the pressures about: three bodies in contact took
/// 23 iterations from a cold start with it and 10 without.
bool Loop::is_near() const {
  constexpr Real near = 0.1;
  const bool cold = is_cold();
  const bool cut = !outcome_.history.empty() && outcome_.history.back().step < 1;
  return report_.relative() < near || (!cold && !cut);
}

/// Steps that seek contacts are to be nearer to Newton's: each decides which nodes hold.
Real Loop::loosest() const {
  constexpr Real with_branches = 1e-2;
  return op_.has_terms() ? std::min(with_branches, options_.largest_forcing) : options_.largest_forcing;
}

/// Tolerance of the next linear solve; previous_norm: the residual's before the last step, 0 = none.
Real Loop::forcing(Real previous_norm) {
  if (previous_norm > 0) {
    const Real ratio = sound_norm() / previous_norm;
    const Real guard = forcing_factor * forcing_ * forcing_;
    forcing_ = std::min(loosest(), forcing_factor * ratio * ratio);
    if (guard > 0.1) forcing_ = std::max(forcing_, guard);
  }
  const Real wanted = options_.tolerance * report_.reference / report_.norm;
  if (forcing_ > wanted) return forcing_;  // more steps will follow
  constexpr Real margin = 0.5;
  const Real last = margin * std::min(options_.linear_tolerance, options_.tolerance);
  return std::clamp(last * report_.reference / report_.norm, 1e-10, loosest());
}

/// Slope [W] of the potential along the step at a share of it; the state is put there.
Real Loop::power_at(const StokesState& start, Real share) {
  state_ = start;
  op_.add_step(step_, share, 1, state_);
  evaluate();
  return op_.residual_power(residual_, step_);
}

/// The share of a Newton step at which the potential's slope has fallen enough, or its best estimate, with the state
/// there. slope: at share 0, < 0. Illinois' regula falsi between a share that descends and one that rises.
Real Loop::cut_share(const StokesState& start, Real slope) {
  Real share = 1;
  Real low = 0;
  Real high = 1;
  Real slope_low = slope;
  Real slope_high = power_at(start, share);
  if (slope_high <= steepest_share * -slope) return share;  // so too where the potential still falls
  for (int cut = 0; cut < options_.max_cuts; ++cut) {
    const Real width = high - low;
    const Real secant = low + width * slope_low / (slope_low - slope_high);
    share = std::clamp(secant, low + 0.1 * width, low + 0.5 * width);
    const Real here = power_at(start, share);
    if (std::abs(here) <= steepest_share * -slope) break;
    (here < 0 ? low : high) = share;
    (here < 0 ? slope_low : slope_high) = here;
  }
  return share;
}

/// Puts the state at a share of the step. With the new pressures the flow minimises a convex potential, whose slope
/// along the step is power_at(): Newton's direction descends in it, whatever the norm of the residual does. False, with
/// the state as before, where it does not (a linear solve that was too loose).
bool Loop::search(bool newton) {
  if (op_.has_inertia()) return search_on_norm(newton);
  const StokesState start = state_;
  Real share = 1;
  if (newton) {
    const Real slope = power_at(start, 0);
    if (!(slope < 0)) {
      state_ = start;
      evaluate();
      return false;
    }
    share = cut_share(start, slope);
  } else {
    power_at(start, share);
  }
  outcome_.history.back().step = share;
  outcome_.history.back().residual = report_.relative();
  return true;
}

/// With inertia there is no potential: a Newton step is halved until the residual's norm has fallen. False, with the
/// state as before, where it does not.
bool Loop::search_on_norm(bool newton) {
  const StokesState start = state_;
  const Real before = report_.norm;
  Real share = 1;
  for (int cut = 0; cut <= options_.max_cuts; ++cut, share /= 2) {
    state_ = start;
    op_.add_step(step_, share, share, state_);
    evaluate();
    if (newton && !(report_.norm < before)) continue;
    outcome_.history.back().step = share;
    outcome_.history.back().residual = report_.relative();
    return true;
  }
  state_ = start;
  evaluate();
  return false;
}

bool Loop::may_use_newton() const {
  if (options_.picard_alone) return false;
  return !op_.has_inertia() || report_.relative() < near_with_inertia;
}

void Loop::solve_nonlinear_problem() {
  const int picard_start = op_.sensitivity() < picard_sensitivity ? picard_steps : 0;
  const bool cold = is_cold();
  op_.impose_constraints(state_);
  evaluate();
  int picard_left = cold ? picard_start : 0;
  Real previous_norm = 0;
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    const bool first = cold && iteration == 0;
    if (first) {
      start_viscosity();
      report_ = op_.residual(state_, residual_);
    } else if (reached()) {
      outcome_.converged = true;
      return;
    }
    choose_branches(iteration, cold);
    const bool newton = !first && picard_left <= 0 && may_use_newton();
    if (!first && !newton) --picard_left;
    const Real tolerance = newton ? forcing(previous_norm) : loosest();
    previous_norm = newton ? sound_norm() : 0;
    if (!compute_step(newton, tolerance * sound_norm() / report_.norm)) return;
    StokesState full = state_;
    op_.add_step(step_, 1, 1, full);
    if (!search(newton)) {
      picard_left = 1;
      previous_norm = 0;
    }
    if (!op_.has_terms()) continue;
    op_.choose_branches(Branches::hold, full);
    op_.choose_branches(Branches::follow, state_);
    evaluate();
    outcome_.history.back().residual = report_.relative();
  }
  outcome_.converged = reached();
  if (!outcome_.converged) give_up("no convergence");
}

NewtonOutcome Loop::run() {
  if (op_.is_linear()) {
    solve_linear_problem();
  } else {
    solve_nonlinear_problem();
  }
  op_.remove_pressure_mean(state_);
  outcome_.residual = report_.relative();
  return outcome_;
}

}  // namespace

NewtonOutcome NewtonSolver::solve(StokesOperator& op, StokesLinearSolver& linear, StokesState& state) const {
  return Loop(options_, op, linear, state).run();
}

}  // namespace malleus
