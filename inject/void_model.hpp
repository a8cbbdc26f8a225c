#pragma once

/// What void does to the flow.

#include <nlohmann/json.hpp>
#include <optional>

#include "inject/filling_state.hpp"
#include "inject/trapped_gas.hpp"

namespace malleus::inject {

/// Void is not modelled: its elements leave the equations, and the front is a free surface at the pressure of the vent
/// that the void reaches. A closed pocket has one pressure: an unknown that keeps its volume, or with [air] that of its
/// gas, taken at the end of the step (implicitly: a step may be longer than the gas needs to come to rest), or none,
/// for air that escapes. For the transport the front's velocity goes on into the void.
class VoidModel {
 public:
  VoidModel(Scene& scene, FrontSet& fronts, Mixture& mixture);

  /// After the mesh was replaced. Local.
  void rebuild();
  /// Regions and gas as the mixture is now. time [s]: of the pressures outside. Collective.
  void find(Real time);
  /// Adds the pressures to the conditions of the flow; pockets of unknown pressure come after its gates. dt: over which
  /// gas is compressed, s; 0 = it has the pressure that it has now. Local.
  void add_to(FlowConditions& conditions, Real dt);
  /// After a solve: pressures and velocities where nothing was solved, in the fields and the unknowns. inflow: through
  /// the inlets, m^3/s. Collective.
  void fill(std::span<const Real> element_viscosity, Real inflow, StokesState& unknowns);

  /// Largest step [s] in which no pocket of gas changes its volume by more than a tenth; infinity without one.
  Real largest_step() const;
  bool has_gas() const { return gas_.has_value(); }
  /// Volume [m^3] and largest pressure [Pa] of trapped gas, as of the last solve.
  std::array<Real, 2> trapped_gas() const;

  nlohmann::json save() const;
  void load(const nlohmann::json& saved);

 private:
  bool is_closed(std::size_t region) const { return !voids_.regions[region].is_vented; }
  Real shrinkage(Real dt) const;
  void read_pressures(std::span<const Real> borders, Real inflow);

  Scene& scene_;
  FrontSet& fronts_;
  Mixture& mixture_;
  std::optional<TrappedGas> gas_;
  NodeConstraints walls_;  ///< of the case alone, void or not
  VoidRegions voids_;
  std::vector<FluxGate> pockets_;  ///< [closed region] of unknown pressure
  std::vector<Real> pressures_;    ///< [region] Pa
  std::vector<Real> inflows_;      ///< [region] m^3/s, that compress it
};

}  // namespace malleus::inject
