#pragma once

/// What drives a tool along its direction: one ordinary differential equation on a scalar, the stroke.

#include <functional>
#include <optional>
#include <vector>

#include "forge/time_scheme.hpp"

namespace malleus::forge {

enum class PressKind { speed, stroke_table, hydraulic, crank, screw, hammer };

/// Points of a stroke_file: times increasing strictly [s], positions [m]; linear between, constant outside.
struct StrokeTable {
  std::vector<Real> times;
  std::vector<Real> positions;
  Real position(Real time) const;
};

struct PressSpec {
  PressKind kind = PressKind::speed;
  std::function<Real(Real)> speed = {};  ///< speed: m/s at a time; hydraulic: the speed below the force limit
  StrokeTable table = {};
  Real force_limit = 0;     ///< hydraulic: N, > 0
  Real crank_radius = 0;    ///< crank: m, > 0
  Real rod_length = 0;      ///< crank: m, > crank_radius
  Real rotation_speed = 0;  ///< crank: rad/s, > 0
  Real start_height = 0;    ///< crank: m above the bottom dead centre at time 0, in (0, 2 crank_radius]
  Real energy = 0;          ///< hammer, screw: J of the blow, > 0
  Real mass = 0;            ///< hammer: kg; screw: the mass that has the blow's energy at its starting speed
};

/// The state that a checkpoint keeps.
struct PressState {
  Real stroke = 0;         ///< m since the start
  Real speed = 0;          ///< m/s, of the last increment; of hammer and screw: at the current time
  Real last_speed = 0;     ///< of the increment before (Adams-Bashforth)
  Real last_force = 0;     ///< N, of the increment before
  Real allowed_speed = 0;  ///< hydraulic: the speed that the force limit left, m/s
  bool stopped = false;    ///< hammer, screw: the blow's energy is spent; table: its end is passed
};

/// An increment is planned, solved, perhaps planned again (hydraulic: another speed; any: a shorter step), then
/// committed. Local, alike on all ranks: forces must be reduced before.
class Press {
 public:
  Press() = default;
  explicit Press(PressSpec spec);

  const PressSpec& spec() const noexcept { return spec_; }
  const PressState& state() const noexcept { return state_; }
  void restore(const PressState& state);

  /// The speed at `time` [m/s], under which the tool's velocity enters friction and the first guess.
  Real speed(Real time) const;
  /// How far the tool goes in the increment that starts at `time` [m]. Crank and table: exactly; hammer and screw: by
  /// the scheme of the nodes.
  Real travel(Real time, const Displacement& displacement) const;
  /// Hydraulic: whether the force [N] that resists the planned motion agrees with the press to `tolerance` (relative);
  /// else the speed is changed (by a power law between force and speed, within a bracket) and the increment has to be
  /// solved again. A press that holds still accepts any force. Other presses take any force.
  bool accepts(Real force, Real time, Real tolerance);
  /// Hydraulic: stands still, or goes on back, and takes any force, where no speed was found; until commit().
  void hold_still();
  /// Forgets the trials of this increment, whose way from speed to displacement has changed.
  void forget_trials();
  /// Ends an increment. force: what resists the motion, N. Hammer and screw: m dw/dt = -force, by the nodes' scheme.
  void commit(Real force, Real time, const Displacement& displacement);
  /// Hydraulic: slower than it would be without its force limit, at a time [s].
  bool is_limited(Real time) const;
  /// Hydraulic: the force [N] is far beyond the limit: a die has closed.
  bool is_overloaded(Real force) const;
  /// Hydraulic: at its force limit it crawls, or stands still, at a time [s].
  bool is_stalled(Real time) const;
  /// The largest step in which a blow's work against the force [N] is a small part of its energy [s].
  Real step_limit(Real force) const;

 private:
  bool has_inertia() const noexcept { return spec_.kind == PressKind::hammer || spec_.kind == PressKind::screw; }
  Real next_speed(Real full);
  Real within_bracket();
  Real slower(Real full) const;
  Real crank_drop(Real time) const;  ///< stroke of a crank since time 0

  PressSpec spec_;
  PressState state_;
  /// Hydraulic: a plan of this increment that was refused.
  struct Trial {
    Real speed = 0;
    Real force = 0;
  };
  std::optional<Trial> slow_;    ///< the last with too small a force
  std::optional<Trial> fast_;    ///< the last with too large a one
  std::optional<Trial> faster_;  ///< the one before
  bool holds_still_ = false;
  int bracketed_ = 0;  ///< plans between the two
};

}  // namespace malleus::forge
