#pragma once

/// The flow's past, for the time derivative of inertia.

#include <nlohmann/json.hpp>
#include <vector>

#include "fem/stokes_operator.hpp"
#include "inject/mixture.hpp"
#include "inject/scene.hpp"

namespace malleus::inject {

/// dv/dt at the end of a step by the backward differentiation formula of second order for steps of any ratio
/// r = dt / dt_before (Hairer, Norsett, Wanner 1993, III.5),
///
///     dt dv/dt = (1+2r)/(1+r) v - (1+r) v_before + r^2/(1+r) v_before_that,
///
/// and by backward Euler in the first step. Fields: velocity [m/s] at the start of the step, and velocity_before.
class FlowHistory {
 public:
  explicit FlowHistory(Scene& scene);

  /// Densities of the mixture as it is and the derivative for a step dt [s]; 0: a steady flow. Local.
  FlowInertia inertia(const Mixture& mixture, Real dt) const;
  /// To be called when a step dt [s] is done; old_velocity: that at its start. Local.
  void accept(std::span<const Real> old_velocity, Real dt);

  nlohmann::json save() const { return dt_before_; }
  void load(const nlohmann::json& saved) { dt_before_ = saved; }

 private:
  Scene& scene_;
  Real dt_before_ = 0;  ///< 0: there was no step
};

}  // namespace malleus::inject
