#include "inject/traced_front.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/index.hpp"
#include "solvers/arrival_trace.hpp"

namespace malleus::inject {
namespace {

constexpr Real never = -1;
/// What counts as the fluid at the start, in elements: gates lie on its border.
constexpr Real at_border = 1e-6;

}  // namespace

TracedFront::TracedFront(Scene& scene)
    : scene_(scene), follows_formulas_(scene.settings.flow.is_prescribed() && scene.settings.inlets.empty()) {
  if (follows_formulas_) return;
  scene_.fields.declare(scene_.mesh, {"arrival_time", "s", Support::node, 1, Transfer::interpolate, false});
}

/// Velocity at the nodes with what the subscales carry around them; what stands still does so.
std::vector<Real> TracedFront::carrying_velocity() const {
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  const std::span<const Real> at_nodes = scene_.fields["velocity"].values();
  std::vector<Real> velocity(at_nodes.begin(), at_nodes.end());
  if (scene_.subscale_velocity.empty()) return velocity;
  std::vector<Real> sums(index(scene_.mesh.nodes()) * (dim + 1), 0.0);
  for (LocalId e = 0; e < scene_.mesh.elements(); ++e) {
    const Real measure = scene_.measures[index(e)];
    for (const LocalId node : scene_.mesh.nodes_of_element(e)) {
      Real* place = sums.data() + index(node) * (dim + 1);
      for (std::size_t c = 0; c < dim; ++c) place[c] += measure * scene_.subscale_velocity[index(e) * dim + c];
      place[dim] += measure;
    }
  }
  scene_.mesh.node_halo.add_to_owners(std::span(sums), scene_.mesh.dim + 1);
  scene_.mesh.node_halo.update_copies(std::span(sums), scene_.mesh.dim + 1);
  for (std::size_t node = 0; node < index(scene_.mesh.nodes()); ++node) {
    Real* v = velocity.data() + node * dim;
    const Real* place = sums.data() + node * (dim + 1);
    if (std::all_of(v, v + dim, [](Real component) { return component == 0; })) continue;
    for (std::size_t c = 0; c < dim; ++c) v[c] += place[c] / place[dim];
  }
  return velocity;
}

Real TracedFront::fastest() const {
  Real largest = 0;
  for (const Real component : scene_.fields["velocity"].values()) largest = std::max(largest, std::abs(component));
  return std::max(scene_.comm.max(largest), std::numeric_limits<Real>::min());
}

void TracedFront::trace(std::span<const Real> start, const WallWetting& wetting) {
  if (follows_formulas_) return;
  std::vector<Real> reached(start.begin(), start.end());
  for (Real& value : reached) value += at_border * scene_.element_size;
  std::vector<Real> times = arrival_times(scene_.comm, scene_.mesh, carrying_velocity(), reached);
  // Walls take the time of their nearest node off the wall: as lengths, largest where the fluid comes first.
  constexpr Real rank_of_never = -1e200;
  const Real speed = fastest();
  for (Real& time : times) time = std::isfinite(time) ? -time * speed : rank_of_never;
  wetting.apply(times);
  for (Real& time : times) time = time > 0.5 * rank_of_never ? std::max(0.0, -time) / speed : never;
  scene_.fields["arrival_time"].assign(std::move(times));
}

void TracedFront::evaluate(Real time, std::span<Real> level_set) const {
  if (follows_formulas_) return follow_formulas(time, level_set);
  const std::span<const Real> arrival = scene_.fields["arrival_time"].values();
  const Real speed = fastest();
  const Real far = std::cbrt(scene_.cavity) + scene_.element_size;
  for (std::size_t node = 0; node < level_set.size(); ++node) {
    const Real distance = arrival[node] == never ? -far : (time - arrival[node]) * speed;
    level_set[node] = std::clamp(distance, -far, far);
  }
}

std::vector<Real> TracedFront::velocities_at(std::span<const Real> places, Real time) const {
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  std::vector<Real> velocities(places.size(), 0.0);
  std::vector<Real> component(places.size() / dim);
  for (std::size_t c = 0; c < dim; ++c) {
    const auto& formula = scene_.settings.flow.prescribed[c];
    if (!formula) continue;
    formula->evaluate(places, scene_.mesh.dim, time, component);
    for (std::size_t n = 0; n < component.size(); ++n) velocities[n * dim + c] = component[n];
  }
  return velocities;
}

void TracedFront::follow_formulas(Real time, std::span<Real> level_set) const {
  std::vector<Real> places(scene_.mesh.coordinates);
  const auto moved = [&](const std::vector<Real>& velocity, Real dt) {
    std::vector<Real> result(places);
    for (std::size_t i = 0; i < result.size(); ++i) result[i] -= dt * velocity[i];
    return result;
  };
  Real left = time;
  while (left > 0) {
    const std::vector<Real> first = velocities_at(places, left);
    Real fastest = 0;
    for (const Real component : first) fastest = std::max(fastest, std::abs(component));
    fastest = scene_.comm.max(fastest);
    constexpr Real longest_share = 1.0 / 16;  // of the time: a flow that turns may be slow when it is looked at
    Real dt = std::min(left, std::max(longest_share * time, 1e-3 * left));
    if (fastest * dt > scene_.element_size) dt = scene_.element_size / fastest;
    const std::vector<Real> second = velocities_at(moved(first, dt / 2), left - dt / 2);
    const std::vector<Real> third = velocities_at(moved(second, dt / 2), left - dt / 2);
    const std::vector<Real> last = velocities_at(moved(third, dt), left - dt);
    for (std::size_t i = 0; i < places.size(); ++i) {
      places[i] -= dt / 6 * (first[i] + 2 * second[i] + 2 * third[i] + last[i]);
    }
    left = dt < left ? left - dt : 0;
  }
  const auto dim = static_cast<std::size_t>(scene_.mesh.dim);
  for (std::size_t node = 0; node < level_set.size(); ++node) {
    std::array<Real, 3> place = {0, 0, 0};
    std::copy_n(places.data() + node * dim, dim, place.begin());
    Real value = std::numeric_limits<Real>::lowest();
    for (const InitialShape& shape : scene_.settings.shapes) {
      value = std::max(value, shape.signed_distance(place, scene_.mesh.dim));
    }
    level_set[node] = value;
  }
}

}  // namespace malleus::inject
