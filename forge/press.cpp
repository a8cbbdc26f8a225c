#include "forge/press.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace malleus::forge {
namespace {

/// A blow is over when this share of the starting speed is left (1e-6 of the energy).
constexpr Real spent_speed = 1e-3;
/// Largest work of a step of a hammer: a share of the energy left, but not below a share of the blow's; near the end
/// again a share of what is left.
constexpr Real share_of_rest = 0.03;
constexpr Real share_of_blow = 0.003;
constexpr Real share_at_end = 0.36;  // a fifth of the speed
/// A hydraulic press slower than this share of its full speed is not asked to meet its limit in more plans than so
/// many.
constexpr Real crawling = 1e-3;
constexpr int most_bracketed = 8;
/// Of the force as a power of the speed, where nothing is known of it.
constexpr Real usual_exponent = 0.3;
/// So many times its limit tells that a die has closed in the increment.
constexpr Real overload = 2;

}  // namespace

Real StrokeTable::position(Real time) const {
  if (time <= times.front()) return positions.front();
  if (time >= times.back()) return positions.back();
  const auto after = static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin());
  const Real share = (time - times[after - 1]) / (times[after] - times[after - 1]);
  return positions[after - 1] + share * (positions[after] - positions[after - 1]);
}

Press::Press(PressSpec spec) : spec_(std::move(spec)) {
  if (has_inertia()) state_.speed = std::sqrt(2 * spec_.energy / spec_.mass);
  if (spec_.kind == PressKind::hydraulic) state_.allowed_speed = std::numeric_limits<Real>::max();
}

void Press::restore(const PressState& state) {
  state_ = state;
  forget_trials();
}

/// Height of the ram above the bottom dead centre at the angle a from it: r (1 - cos a) + l - sqrt(l^2 - r^2 sin^2 a).
Real Press::crank_drop(Real time) const {
  const Real r = spec_.crank_radius;
  const Real l = spec_.rod_length;
  const auto height = [&](Real angle) {
    const Real side = r * std::sin(angle);
    return r * (1 - std::cos(angle)) + l - std::sqrt(l * l - side * side);
  };
  const Real start_rod =
      l + r - spec_.start_height;  // distance of pin and ram's joint from the shaft, by the cosine law
  const Real cosine = (start_rod * start_rod + r * r - l * l) / (2 * r * start_rod);
  const Real start_angle = std::acos(std::clamp(cosine, -1.0, 1.0));
  return spec_.start_height - height(start_angle - spec_.rotation_speed * time);
}

Real Press::speed(Real time) const {
  switch (spec_.kind) {
    case PressKind::speed:
      return spec_.speed(time);
    case PressKind::hydraulic:
      return std::min(spec_.speed(time), state_.allowed_speed);
    case PressKind::hammer:
    case PressKind::screw:
      return state_.stopped ? 0 : state_.speed;
    case PressKind::stroke_table: {
      const Real tiny = 1e-9 * (spec_.table.times.back() - spec_.table.times.front());
      return (spec_.table.position(time + tiny) - spec_.table.position(time)) / tiny;
    }
    case PressKind::crank: {
      const Real tiny = 1e-6 / spec_.rotation_speed;
      return (crank_drop(time + tiny) - crank_drop(time - tiny)) / (2 * tiny);
    }
  }
  return 0;
}

Real Press::travel(Real time, const Displacement& displacement) const {
  switch (spec_.kind) {
    case PressKind::stroke_table:
      return spec_.table.position(time + displacement.step) - spec_.table.position(time);
    case PressKind::crank:
      return crank_drop(time + displacement.step) - crank_drop(time);
    case PressKind::hammer:
    case PressKind::screw:
      return state_.stopped
                 ? 0
                 : displacement.step * (displacement.now * state_.speed + displacement.before * state_.last_speed);
    case PressKind::speed:  // Simpson's rule: exact for speeds up to the third power of time
      return displacement.step / 6 *
             (spec_.speed(time) + 4 * spec_.speed(time + 0.5 * displacement.step) +
              spec_.speed(time + displacement.step));
    case PressKind::hydraulic:
      return displacement.step * (displacement.now * speed(time) + displacement.before * state_.last_speed);
  }
  return 0;
}

bool Press::accepts(Real force, Real time, Real tolerance) {
  if (spec_.kind != PressKind::hydraulic) return true;
  const Real full = spec_.speed(time);
  const Real speed_now = speed(time);
  const bool is_limited = state_.allowed_speed < full;
  if (!is_limited && force <= spec_.force_limit * (1 + tolerance)) return true;
  if (is_limited && std::abs(force - spec_.force_limit) <= tolerance * spec_.force_limit) return true;
  if (holds_still_ && force > spec_.force_limit) return true;  // what it holds is not its doing
  if (bracketed_ > most_bracketed && std::abs(speed_now) < crawling * full) return true;  // solves are not that sharp
  if (force > spec_.force_limit) {
    faster_ = fast_;
    fast_ = {speed_now, force};
  } else {
    slow_ = {speed_now, force};
  }
  state_.allowed_speed = next_speed(full);
  return false;
}

void Press::hold_still() {
  state_.allowed_speed = std::min(state_.allowed_speed, 0.0);
  holds_still_ = true;
}

void Press::forget_trials() {
  slow_.reset();
  fast_.reset();
  faster_.reset();
  bracketed_ = 0;
  holds_still_ = false;
}

/// The next speed to try: by the power law through what was tried, kept within the bracket where there is one.
Real Press::next_speed(Real full) {
  constexpr Real creeping = 1e-7;  // of the full speed
  const Real limit = spec_.force_limit;
  if (slow_ && fast_) return within_bracket();
  if (fast_) return slower(full);
  if (!(slow_->force > 0)) return std::numeric_limits<Real>::max();  // nothing resists: full speed
  const Real from = std::max(slow_->speed, creeping * full);
  return from * std::clamp(std::pow(limit / slow_->force, 1 / usual_exponent), 1.1, 1e3);
}

/// Where a die closes the force jumps within the bracket: halving finds the place. Elsewhere the force follows a power
/// of the speed.
Real Press::within_bracket() {
  const Real limit = spec_.force_limit;
  const Real width = fast_->speed - slow_->speed;
  const Real middle = slow_->speed + 0.5 * width;
  const bool jumps = is_overloaded(fast_->force) && 2 * slow_->force < limit;
  if (++bracketed_ % 3 == 0 || jumps) return middle;
  Real guess = slow_->speed + width * (limit - slow_->force) / (fast_->force - slow_->force);
  if (slow_->speed > 0 && slow_->force > 0) {
    const Real exponent = std::log(fast_->force / slow_->force) / std::log(fast_->speed / slow_->speed);
    if (exponent > 0) guess = slow_->speed * std::pow(limit / slow_->force, 1 / exponent);
  }
  return std::clamp(guess, slow_->speed + 0.02 * width, fast_->speed - 0.02 * width);
}

/// All that was tried was too fast: slower by a power law. In a die that is nearly full the force falls
/// much faster than by any power of the speed, in one that is full linearly, by what the contacts' penalties give way;
/// a full die may push the press back by a little.
Real Press::slower(Real full) const {
  constexpr Real least_share = 0.3;
  constexpr Real largest_retreat = 0.02;
  constexpr Real nudge = 1e-5;
  const Real limit = spec_.force_limit;
  const bool is_closed = is_overloaded(fast_->force) || fast_->speed < crawling * full;
  if (is_closed && faster_ && faster_->force > fast_->force) {
    const Real slope = (faster_->force - fast_->force) / (faster_->speed - fast_->speed);
    const Real linear = fast_->speed - (fast_->force - limit) / slope;
    return std::max(std::min(linear, 0.9 * fast_->speed), -largest_retreat * full);
  }
  const Real less = fast_->speed * std::clamp(std::pow(limit / fast_->force, 1 / usual_exponent), least_share, 0.9);
  if (less > crawling * full) return less;
  return fast_->speed > 0 ? 0 : fast_->speed - nudge * full;
}

void Press::commit(Real force, Real time, const Displacement& displacement) {
  const Real way = travel(time, displacement);
  state_.stroke += way;
  forget_trials();
  if (state_.allowed_speed < 0) state_.allowed_speed = 0;
  if (!has_inertia()) {
    state_.last_speed = speed(time);
    state_.speed = state_.last_speed;
  } else if (!state_.stopped) {
    const Real first_speed = std::sqrt(2 * spec_.energy / spec_.mass);
    const Real mean_force = displacement.now * force + displacement.before * state_.last_force;
    state_.last_speed = state_.speed;
    state_.speed -= displacement.step * mean_force / spec_.mass;
    if (state_.speed < spent_speed * first_speed) {
      state_.stopped = true;
      state_.speed = 0;
    }
  }
  if (spec_.kind == PressKind::stroke_table) {
    state_.stopped = time + (1 + 1e-9) * displacement.step >= spec_.table.times.back();
  }
  state_.last_force = force;
}

bool Press::is_limited(Real time) const {
  return spec_.kind == PressKind::hydraulic && state_.allowed_speed < spec_.speed(time);
}

bool Press::is_overloaded(Real force) const {
  return spec_.kind == PressKind::hydraulic && force > overload * spec_.force_limit;
}

bool Press::is_stalled(Real time) const {
  if (spec_.kind != PressKind::hydraulic) return false;
  const Real full = spec_.speed(time);
  return full > 0 && state_.allowed_speed < crawling * full;
}

Real Press::step_limit(Real force) const {
  if (!has_inertia() || state_.stopped || !(force > 0)) return std::numeric_limits<Real>::max();
  const Real rest = 0.5 * spec_.mass * state_.speed * state_.speed;
  const Real work = std::max(share_of_rest * rest, std::min(share_at_end * rest, share_of_blow * spec_.energy));
  return work / (force * state_.speed);
}

}  // namespace malleus::forge
