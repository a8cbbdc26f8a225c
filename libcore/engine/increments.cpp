#include "engine/increments.hpp"

#include <algorithm>
#include <cmath>

namespace malleus {

Real planned_step(Real allowed, Real time, Real end) {
  const Real remaining = end - time;
  if (!std::isfinite(remaining)) return allowed;
  return std::isfinite(allowed) ? remaining / std::max(1.0, std::ceil(remaining / allowed - 1e-9)) : remaining;
}

Outcome try_components(Process& process, const std::function<Outcome(Component&)>& advance) {
  std::vector<Component*> done;
  for (Component* component : process.components()) {
    const Outcome outcome = advance(*component);
    if (outcome.kind == Outcome::Kind::done) {
      done.push_back(component);
      continue;
    }
    for (auto undone = done.rbegin(); undone != done.rend(); ++undone) (*undone)->roll_back();
    return {outcome.kind, component->name() + ": " + outcome.why, outcome.step};
  }
  return Outcome::done();
}

Increment shortened(const Increment& increment, Real start, const Outcome& outcome) {
  const bool tells_step = outcome.step > 0 && outcome.step < increment.dt;
  const Real dt = tells_step ? outcome.step : increment.dt / 2;
  return {increment.number, start + dt, dt};
}

}  // namespace malleus
