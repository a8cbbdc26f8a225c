#pragma once

/// The filling component: how full the cavity is, and whether it is done.

#include <optional>
#include <string>

#include "engine/component.hpp"
#include "inject/air_pockets.hpp"
#include "inject/filling_state.hpp"
#include "inject/front_set.hpp"

namespace malleus::inject {

/// Measures the filled volume after each increment and tells why a run is over.
class Filling final : public Component {
 public:
  Filling(Scene& scene, FrontSet& fronts, FillingState& state);

  std::string name() const override { return "filling"; }
  std::string purpose() const override { return "measures the filled volume"; }
  FieldUse uses() const override { return {fronts_.names(), {}, {}}; }
  Outcome advance(const Increment& increment) override;
  void roll_back() override { state_ = before_; }

  Real fill_fraction() const;
  /// Filled minus initial minus injected, over the cavity.
  Real volume_error() const;
  /// Volume [m^3] that is not filled, 0 where the scene has no front.
  Real unfilled() const;
  /// Air that has no way to an opening, largest first, as of the last increment.
  std::vector<AirPocket> trapped_air() const;
  /// "cavity full", "short shot: ...": nothing more happens.
  std::optional<std::string> finished() const;

 private:
  std::string largest_pocket() const;

  Scene& scene_;
  FrontSet& fronts_;
  FillingState& state_;
  FillingState before_;
  std::vector<AirPocket> pockets_;
  bool stands_still_ = false;
};

}  // namespace malleus::inject
