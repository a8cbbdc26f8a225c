#include "inject/flow_history.hpp"

namespace malleus::inject {

FlowHistory::FlowHistory(Scene& scene) : scene_(scene) {
  scene_.fields.declare(scene_.mesh,
                        {"velocity_before", "m/s", Support::node, scene_.mesh.dim, Transfer::interpolate, false});
}

FlowInertia FlowHistory::inertia(const Mixture& mixture, Real dt) const {
  FlowInertia inertia;
  inertia.density.resize(static_cast<std::size_t>(scene_.mesh.elements()));
  for (LocalId e = 0; e < scene_.mesh.elements(); ++e) {
    inertia.density[static_cast<std::size_t>(e)] = mixture.density(e);
  }
  if (!(dt > 0)) return inertia;
  const Real ratio = dt_before_ > 0 ? dt / dt_before_ : 0;
  inertia.rate = (1 + 2 * ratio) / (1 + ratio) / dt;
  const Real of_last = (1 + ratio) / dt;
  const Real of_before = -ratio * ratio / (1 + ratio) / dt;
  const std::span<const Real> last = scene_.fields["velocity"].values();
  const std::span<const Real> before = scene_.fields["velocity_before"].values();
  inertia.history.resize(last.size());
  for (std::size_t i = 0; i < last.size(); ++i) inertia.history[i] = of_last * last[i] + of_before * before[i];
  return inertia;
}

void FlowHistory::accept(std::span<const Real> old_velocity, Real dt) {
  scene_.fields["velocity_before"].assign({old_velocity.begin(), old_velocity.end()});
  dt_before_ = dt;
}

}  // namespace malleus::inject
