#pragma once

/// A front in a flow that does not change: traced back along the stream, not transported ([front] transport = trace).

#include <span>
#include <vector>

#include "inject/front_set.hpp"
#include "solvers/level_set_wetting.hpp"

namespace malleus::inject {

/// In a flow that is solved once the front passes each node at its arrival time T (see arrival_times()): one trace in
/// all, and the level set at a time t is (t - T) U, U the largest speed. In a flow that formulas
/// prescribe, and that no inlet feeds, each node is followed back to the start by the classical Runge-Kutta method with
/// steps of an element, and takes the level set of the case's shapes there. Field: arrival_time [s], -1 where the
/// fluid never comes.
class TracedFront {
 public:
  explicit TracedFront(Scene& scene);

  /// Whether the trace follows formulas.
  bool follows_formulas() const { return follows_formulas_; }
  /// The one trace, where the flow is solved. start: level set at the start. Collective.
  void trace(std::span<const Real> start, const WallWetting& wetting);
  /// The level set at a time [s]. Collective.
  void evaluate(Real time, std::span<Real> level_set) const;

 private:
  std::vector<Real> carrying_velocity() const;
  Real fastest() const;  ///< largest component of the velocity, m/s
  void follow_formulas(Real time, std::span<Real> level_set) const;
  std::vector<Real> velocities_at(std::span<const Real> places, Real time) const;

  Scene& scene_;
  bool follows_formulas_;
};

}  // namespace malleus::inject
