#pragma once

/// What a process is made of.

#include <string>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// One step of time. All times in s.
struct Increment {
  GlobalId number = 0;  ///< from 1
  Real time = 0;        ///< at its end
  Real dt = 0;

  Real start() const noexcept { return time - dt; }
};

/// How a component's part of an increment ended: equal on all ranks.
struct Outcome {
  enum class Kind {
    done,
    retry_smaller,  ///< the increment should be tried again with a smaller step
    failed          ///< no smaller step would help
  };
  Kind kind = Kind::done;
  std::string why;  ///< for the log: what failed, and where
  Real step = 0;    ///< retry_smaller: the step to try, s; 0 = half of it

  static Outcome done() { return {}; }
  static Outcome retry(std::string reason) { return {Kind::retry_smaller, std::move(reason), 0}; }
  static Outcome retry(std::string reason, Real step) { return {Kind::retry_smaller, std::move(reason), step}; }
  static Outcome fail(std::string reason) { return {Kind::failed, std::move(reason), 0}; }
};

/// The fields that a component touches, by name.
struct FieldUse {
  std::vector<std::string> reads;   ///< must have a value: from an earlier component, or from some start()
  std::vector<std::string> writes;  ///< has a value after advance()
  std::vector<std::string> starts;  ///< has a value after start()
};

/// One piece of a process (the flow, the contact search, the motion, the front). Every call is collective.
class Component {
 public:
  virtual ~Component() = default;
  virtual std::string name() const = 0;     ///< as in the plan and in summary.json: "flow"
  virtual std::string purpose() const = 0;  ///< one line for the plan
  virtual FieldUse uses() const { return {}; }
  /// The initial state, in a new run (a restarted one has its fields already).
  virtual void start() {}
  /// Its part of an increment. A component that does not return done leaves the state as it found it.
  virtual Outcome advance(const Increment& increment) = 0;
  /// Undoes advance() of an increment that a later component gave up.
  virtual void roll_back() {}
  /// Its part of a run of no increments, where the scene is solved once as it stands.
  virtual Outcome solve_once() { return Outcome::done(); }
};

}  // namespace malleus
