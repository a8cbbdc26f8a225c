#include "inject/filling.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "fem/level_set_volume.hpp"

namespace malleus::inject {
namespace {

constexpr Real full = 0.999;
/// Of what enters in an increment, the share that must stay for the filling to go on.
constexpr Real smallest_gain = 0.02;
/// Of the cavity, the air before open vents below which they count as closed: what is left are last corners of vents,
/// through which nothing but pressure would come.
constexpr Real last_corners = 5e-4;

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
  stands_still_ =
      !scene_.settings.common.air && entered > 0 && filled > 0.5 * scene_.cavity && gain < smallest_gain * entered;
  state_.filled = std::min(filled, scene_.cavity);
  const bool has_vents = !scene_.settings.vents.empty();
  pockets_ = find_air_pockets(scene_, fronts_);
  Real vented = 0;
  for (const AirPocket& pocket : pockets_) vented += pocket.is_vented ? pocket.volume : 0;
  state_.is_closed =
      has_vents && !scene_.settings.common.air && (!fronts_.has_way_out() || vented < last_corners * scene_.cavity);
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

std::string Filling::largest_pocket() const {
  if (pockets_.empty()) return "";
  const AirPocket& largest = pockets_.front();
  return fmt::format(", the largest part, {:.4g} m^3, around ({:.4g}, {:.4g}, {:.4g}) m", largest.volume,
                     largest.place[0], largest.place[1], largest.place[2]);
}

/// Larger than an element: smaller ones are what the mesh does not resolve.
std::vector<AirPocket> Filling::trapped_air() const {
  std::vector<AirPocket> trapped;
  const Real element = scene_.cavity / static_cast<Real>(std::max<GlobalId>(1, scene_.mesh.total_elements));
  for (const AirPocket& pocket : pockets_) {
    if (pocket.volume > element && (!pocket.is_vented || state_.is_closed)) trapped.push_back(pocket);
  }
  return trapped;
}

std::optional<std::string> Filling::finished() const {
  if (fronts_.size() == 0 || scene_.settings.inlets.empty()) return std::nullopt;
  const Real element = scene_.cavity / static_cast<Real>(std::max<GlobalId>(1, scene_.mesh.total_elements));
  if (fill_fraction() >= full || unfilled() < element) return "cavity full";
  if (state_.is_closed) {
    return fmt::format("short shot: the vents are covered, {:.4g} m^3 of what was in the cavity stay in it{}",
                       unfilled(), largest_pocket());
  }
  if (stands_still_) {
    return fmt::format("short shot: what enters leaves through the vents, {:.4g} m^3 stay unfilled", unfilled());
  }
  return std::nullopt;
}

}  // namespace malleus::inject
