#pragma once

/// Floating-point traps and libraries that are not written for them.

#include <cfenv>

namespace malleus {

/// No floating-point traps in its scope: LAPACK, for one, divides by zero to learn how the machine does it.
class TrapsOff {
 public:
  TrapsOff() { std::feholdexcept(&environment_); }
  TrapsOff(const TrapsOff&) = delete;
  TrapsOff& operator=(const TrapsOff&) = delete;
  ~TrapsOff() { std::fesetenv(&environment_); }

 private:
  std::fenv_t environment_{};
};

}  // namespace malleus
