#pragma once

/// How positions follow velocities within an increment.

#include <string>

#include "base/types.hpp"

namespace malleus::forge {

enum class TimeScheme { adams_bashforth_2, runge_kutta_2, euler };

/// One solve's part in an increment: with v the velocity that is solved for, the increment ends at
/// x_end = x_start + step * (now * v + before * v_before). The contact conditions are written for x_end.
struct Displacement {
  Real step = 0;    ///< s
  Real now = 1;     ///< weight of the velocity that is being solved for, > 0
  Real before = 0;  ///< weight of the velocity of the last increment
};

/// Euler: x += dt v. Also the first stage of RK2, which then goes half way only.
inline Displacement euler_step(Real step) {
  return {step, 1, 0};
}

/// Adams-Bashforth 2 with the ratio of this step to the last: weights 1 + ratio/2 and -ratio/2.
inline Displacement adams_bashforth_step(Real step, Real last_step) {
  const Real ratio = step / last_step;
  return {step, 1 + 0.5 * ratio, -0.5 * ratio};
}

}  // namespace malleus::forge
