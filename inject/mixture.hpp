#pragma once

/// The fluids' shares in each element, and the viscosity and density that follow (paper, eq. [9] and [10]).

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fem/viscosity_model.hpp"
#include "inject/sections.hpp"
#include "material/viscous_law.hpp"

namespace malleus::inject {

/// Share of a fluid in an element, from its level set at the element's nodes (positive inside) and the element's size
/// [m]: exact cut fraction (also for harmonic), 1/2 + alpha/(2e) by the mean alpha (heaviside, e = thickness sizes), or
/// the sign of the mean (sharp).
Real share_of(MixtureLaw law, std::span<const Real> level_set, Real size, Real thickness);

/// Viscosity of a mixture and its slope (d eta / d gamma) / gamma.
struct MixedViscosity {
  Real viscosity = 0;  ///< Pa.s
  Real slope = 0;      ///< Pa.s^3
};

/// sum f_k eta_k, or for harmonic 1 / sum (f_k / eta_k). A fluid of no viscosity (void) is left out of harmonic means.
MixedViscosity mix(MixtureLaw law, std::span<const Real> shares, std::span<const MixedViscosity> fluids);

/// A fluid as the flow sees it.
struct Fluid {
  std::string name;
  std::unique_ptr<const ViscousLaw> law;  ///< none: void, or given
  Expression given;                       ///< Pa.s, of space; where `is_given`
  bool is_given = false;
  Real lowest = 0;   ///< Pa.s: thinner than this is not modelled (contrast)
  Real density = 0;  ///< kg/m^3
};

/// Which fluid a level set surrounds.
struct FluidLevelSet {
  int fluid = 0;
  std::span<const Real> values;  ///< [node], positive inside
};

/// The viscosity model of the flow: all fluids, by their shares.
class Mixture final : public ViscosityModel {
 public:
  /// background: what fills the space outside all level sets.
  Mixture(std::vector<Fluid> fluids, int background, MixtureLaw law, Real thickness);

  /// Elements that hold one fluid whatever the level sets say (those at a gate), where the background is void: it could
  /// not flow otherwise. Local.
  void set_fed(std::vector<std::pair<LocalId, int>> fed) { fed_ = std::move(fed); }
  /// Whether the background is not modelled.
  bool has_void() const;

  /// Shares from the level sets as they are. Where level sets overlap, shares are scaled to a sum of 1. Beside void, an
  /// element of which less than 1 % is filled counts as empty. Local.
  void update(const Mesh& mesh, const std::vector<FluidLevelSet>& level_sets);

  std::span<const Real> shares(int fluid) const { return shares_[static_cast<std::size_t>(fluid)]; }  ///< [element]
  Real density(LocalId element) const;                                                                ///< kg/m^3
  const std::vector<Fluid>& fluids() const { return fluids_; }
  int background() const { return background_; }

  void evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                std::span<Real> slope) const override;
  Real sensitivity() const override;
  bool is_linear() const override;

 private:
  void settle_void();
  void evaluate_fluid(const Fluid& fluid, const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                      std::span<Real> slope) const;

  std::vector<Fluid> fluids_;
  int background_;
  MixtureLaw law_;
  Real thickness_;
  std::vector<std::pair<LocalId, int>> fed_;
  std::vector<std::vector<Real>> shares_;  ///< [fluid][element]
};

/// The fluids of a case. cut_off: shear rate [1/s] below which power laws are Newtonian. contrast: largest ratio of
/// viscosities; a fluid that is thickened to keep it is named in the log.
std::vector<Fluid> make_fluids(const InjectCase& settings, Real cut_off, Real contrast);

/// Throws InputError where a viscosity that is given as a formula is not above zero in some element. Collective.
void check_given_viscosities(const Communicator& comm, const Mesh& mesh, const std::vector<Fluid>& fluids);

}  // namespace malleus::inject
