#include "inject/filling.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "fem/level_set_volume.hpp"

namespace malleus::inject {
namespace {

constexpr Real full = 0.999;
/// Of what enters in an increment, the share that must stay for the filling to go on.
constexpr Real smallest_gain = 0.02;

}  // namespace

Filling::Filling(Scene& scene, FrontSet& fronts, FillingState& state) : scene_(scene), fronts_(fronts), state_(state) {}

Outcome Filling::advance(const Increment& increment) {
  before_ = state_;
  Real filled = 0;
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    filled += positive_volume(scene_.comm, scene_.mesh, scene_.measures, fronts_.values(i));
  }
  const Real gain = filled - state_.filled;
  const Real entered = state_.inflow() * increment.dt;
  stands_still_ = entered > 0 && filled > 0.5 * scene_.cavity && gain < smallest_gain * entered;
  state_.filled = std::min(filled, scene_.cavity);
  const bool has_vents = !scene_.settings.vents.empty();
  state_.is_closed = has_vents && !fronts_.has_way_out();
  return Outcome::done();
}

Real Filling::fill_fraction() const {
  return fronts_.size() == 0 ? 1 : state_.filled / scene_.cavity;
}

Real Filling::volume_error() const {
  return fronts_.size() == 0 ? 0 : (state_.filled - state_.initial - state_.injected) / scene_.cavity;
}

Real Filling::unfilled() const {
  return fronts_.size() == 0 ? 0 : std::max(0.0, scene_.cavity - state_.filled);
}

std::optional<std::string> Filling::finished() const {
  if (fronts_.size() == 0 || scene_.settings.inlets.empty()) return std::nullopt;
  const Real element = scene_.cavity / static_cast<Real>(std::max<GlobalId>(1, scene_.mesh.total_elements));
  if (fill_fraction() >= full || unfilled() < element) return "cavity full";
  if (state_.is_closed) {
    return fmt::format("short shot: the vents are covered, {:.4g} m^3 of what was in the cavity stay in it",
                       unfilled());
  }
  if (stands_still_) {
    return fmt::format("short shot: what enters leaves through the vents, {:.4g} m^3 stay unfilled", unfilled());
  }
  return std::nullopt;
}

}  // namespace malleus::inject
