#pragma once

/// The flow component: velocity and pressure of the fluids as the front lies now.

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "engine/component.hpp"
#include "engine/process.hpp"
#include "inject/filling_state.hpp"
#include "inject/flow_conditions.hpp"
#include "inject/flow_history.hpp"
#include "inject/front_set.hpp"
#include "inject/void_model.hpp"
#include "solvers/newton.hpp"

namespace malleus::inject {

/// Solves the Stokes equations for the mixture (paper, eq. [1] with [9]) when the front has moved far enough since the
/// last solve, and keeps the flow in between. With inertia it solves the Navier-Stokes equations, every increment, for
/// the velocity at its end, and starts from rest. Fields: velocity, pressure, viscosity, strain_rate. Void: see
/// VoidModel.
class Flow final : public Component {
 public:
  Flow(Scene& scene, Mixture& mixture, FrontSet& fronts, FillingState& state);

  std::string name() const override { return "flow"; }
  std::string purpose() const override;
  FieldUse uses() const override;
  void start() override;
  Outcome advance(const Increment& increment) override;
  void roll_back() override;
  Outcome solve_once() override;

  /// After the mesh and the fields were replaced. Collective.
  void rebuild();

  /// Solves the flow in the next increment, however little has moved.
  void solve_next() { is_asked_ = true; }

  const LinearTotals& linear_totals() const { return totals_; }
  bool pressure_is_free() const { return pressure_is_free_; }
  /// Distance [elements] that freezing the flow between solves misplaced the front, summed over the solves: half of the
  /// time between two solves times the root mean square over the front of the change of its normal velocity.
  Real freezing_error() const { return freezing_error_; }
  /// Largest step [s] that trapped gas allows.
  Real largest_step() const { return void_ ? void_->largest_step() : std::numeric_limits<Real>::infinity(); }
  /// A step [s] in which the front may go its stride at the speeds of the last solve, from where the scene stands:
  /// shortened where gates ask for more at its start than they did then, or much more towards its end. Collective.
  Real step_with_gates(Real step) const;
  const VoidModel* void_model() const { return void_ ? &*void_ : nullptr; }
  nlohmann::json save() const;
  void load(const nlohmann::json& saved);
  /// What the last solve left, which may be some increments old: to go on from it with the same digits. Local.
  std::vector<Real> save_local() const;
  void load_local(std::span<const Real> saved);

  /// Throws InputError where the conditions at t = 0 cannot be met: before anything is written. Collective.
  void check_conditions();

 private:
  std::vector<GateDrive> present_drives(Real time);
  Outcome advance_inertia(const Increment& increment);
  bool is_due(const std::vector<GateDrive>& drives);
  Real growth_of_drives(Real time) const;
  bool dissipation_changed();
  void refuse_blocked_vents() const;
  Outcome solve(Real time, Real dt);
  Outcome solve_with(const std::vector<GateDrive>& drives, Real time, Real dt);
  /// Makes the operator ready; returns the inlet of each flow-rate gate. dt: see VoidModel.
  std::vector<std::size_t> prepare(const std::vector<GateDrive>& drives, Real time, Real dt);
  bool switch_over(std::vector<GateDrive>& drives);
  void publish(const std::vector<GateDrive>& drives, const std::vector<std::size_t>& gate_inlets);
  Real inflow(std::span<const Real> velocity) const;
  void refresh_mixture();
  StickingNodes sticking_nodes() const;
  void note_freezing(std::span<const Real> old_velocity);
  NewtonOptions newton_options() const;
  void start_from_rest();

  Scene& scene_;
  Mixture& mixture_;
  FrontSet& fronts_;
  FillingState& state_;
  std::unique_ptr<StokesOperator> operator_;
  StokesLinearSolver linear_;
  StokesState unknowns_;
  std::optional<VoidModel> void_;
  std::optional<FlowHistory> history_;  ///< with inertia
  struct Before {
    StokesState unknowns;
    std::vector<Real> velocity, earlier;
    nlohmann::json history;
  };
  Before before_;  ///< the increment, with inertia: for roll_back()
  LinearTotals totals_;
  bool is_solved_ = false;
  bool is_asked_ = false;
  bool pressure_is_free_ = false;
  Real freezing_error_ = 0;
};

/// A flow that the case prescribes: formulas of place and time. Field: velocity.
class PrescribedFlow final : public Component {
 public:
  PrescribedFlow(Scene& scene, FillingState& state);

  std::string name() const override { return "flow"; }
  std::string purpose() const override { return "takes the velocity that the case prescribes"; }
  FieldUse uses() const override { return {{}, {"velocity"}, {"velocity"}}; }
  void start() override { evaluate(0); }
  Outcome advance(const Increment& increment) override;

  /// Velocity field and flow through the inlets at a time [s]. Collective.
  void evaluate(Real time);

 private:
  Scene& scene_;
  FillingState& state_;
};

/// Shear rate [1/s] typical of the case, speed over gap: for power laws' cut-off and the first iteration. Collective.
Real typical_shear_rate(const Scene& scene);

}  // namespace malleus::inject
