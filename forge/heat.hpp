#pragma once

/// The temperature of the bodies.

#include "engine/component.hpp"
#include "forge/contact_flow.hpp"
#include "solvers/heat_equation.hpp"

namespace malleus::forge {

/// Sums over a run, J. stored = dissipated + friction + imposed - lost, to the solver's tolerance.
struct HeatTotals {
  Real stored = 0;
  Real dissipated = 0;  ///< by the deformation
  Real friction = 0;    ///< by friction, what goes into the bodies
  Real imposed = 0;     ///< in through boundaries of given temperature or heat flux
  Real lost = 0;        ///< to tools and surroundings
};

/// One implicit step of the heat equation an increment, on the mesh at its start: sources are the dissipation, with
/// the strain rate that moves the mesh, and friction; heat crosses to tools and bodies where they touch, and by
/// convection and radiation where nothing touches.
class Heat final : public Component {
 public:
  Heat(Scene& scene, const ContactFlow& flow);

  std::string name() const override { return "heat"; }
  std::string purpose() const override;
  FieldUse uses() const override { return {{field_name::velocity}, {field_name::temperature}, {}}; }
  Outcome advance(const Increment& increment) override;
  void roll_back() override;

  const HeatTotals& totals() const noexcept { return totals_; }
  void set_totals(const HeatTotals& totals) { totals_ = totals; }  ///< after a restart

 private:
  void add_constants(HeatScene& heat) const;
  void add_dissipation(HeatScene& heat) const;
  void add_surfaces(HeatScene& heat);
  void add_boundaries(HeatScene& heat, Real time) const;

  Scene& scene_;
  const ContactFlow& flow_;
  HeatEquation equation_;
  Real friction_power_ = 0;  ///< W, of this rank's nodes into the bodies
  HeatTotals totals_;
  std::vector<Real> saved_temperature_;
  HeatTotals saved_totals_;
};

}  // namespace malleus::forge
