#pragma once

/// Trapped air as an ideal gas at constant temperature.

#include <nlohmann/json.hpp>
#include <vector>

#include "inject/void_regions.hpp"

namespace malleus::inject {

/// Follows how much gas each closed region of void holds, p V [J] with the absolute pressure p: pockets keep it, share
/// it by volume where they part, add it where they meet, and lose it where they reach a vent; a region that closes has
/// the pressure of the vent that it had. Pressures beside `absolute` are relative to [air] pressure. Fields: air_pocket
/// (the region of a node as of the last update, -1 = none), air_pressure [Pa].
class TrappedGas {
 public:
  /// absolute: of the air outside, Pa.
  TrappedGas(Scene& scene, Real absolute);

  /// Contents of the regions as they are now. Collective.
  void update(const VoidRegions& voids);
  /// Pressure [Pa] of a region of the last update.
  Real pressure(std::size_t region) const { return contents_[region] / volumes_[region] - absolute_; }
  /// How fast it takes volume in for each pascal [m^3/(s Pa)], where the pressure is asked for at the end of dt [s]:
  /// the secant to the pressure at which the volume [m^3] will be about `end`.
  Real compliance(std::size_t region, Real end, Real dt) const {
    return volumes_[region] * end / (contents_[region] * dt);
  }
  /// Writes air_pressure: inside[k] at the nodes of region k. Local.
  void publish(const VoidRegions& voids, const std::vector<Real>& inside);
  /// The mesh was replaced: regions are known again by air_pressure, whose largest value in them is theirs.
  void forget_places() { knows_places_ = false; }

  nlohmann::json save() const;
  void load(const nlohmann::json& saved);

 private:
  std::vector<Real> contents_by_places(const VoidRegions& voids) const;
  std::vector<Real> contents_by_pressure(const VoidRegions& voids) const;

  Scene& scene_;
  Real absolute_;
  bool knows_places_ = false;
  std::vector<Real> contents_;  ///< [region] J
  std::vector<Real> volumes_;   ///< [region] m^3
  std::vector<char> vented_;    ///< [region]
};

}  // namespace malleus::inject
