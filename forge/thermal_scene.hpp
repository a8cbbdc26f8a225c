#pragma once

/// What heat is in a forging scene: constants of bodies and opponents, and the softening of the material.

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "fem/viscosity_model.hpp"
#include "forge/forge_case.hpp"

namespace malleus::forge {

struct ThermalBody {
  Real conductivity = 0;  ///< W/(m K)
  Real capacity = 0;      ///< J/(m^3 K); 0: the body keeps its temperature
  Expression initial;     ///< K
  std::optional<Expression> softening;

  bool is_modelled() const noexcept { return capacity > 0; }
  /// sqrt(k rho c): of the heat that two bodies make at their contact each takes its share of the sum.
  Real effusivity() const;
};

/// What a body touches: a tool, or another body.
struct ThermalOpponent {
  Real transfer = 0;       ///< W/(m^2 K)
  Real temperature = 0;    ///< K, of a tool
  Real slave_share = 0.5;  ///< of the friction's heat, that goes into the slave
};

struct ThermalScene {
  ThermalSettings settings;
  std::vector<ThermalBody> bodies;         ///< [region]
  std::vector<ThermalOpponent> opponents;  ///< tools first, then pairs of bodies
  /// What consistencies are multiplied with at the increment's start. Empty: nothing softens.
  std::vector<Real> element_softening;  ///< [element]
  std::vector<Real> node_softening;     ///< [local node]

  bool softens() const;
};

/// A model's viscosities times factors [element], which are read anew at each evaluation. Empty factors are ones.
class SoftenedViscosity final : public ViscosityModel {
 public:
  SoftenedViscosity(std::unique_ptr<const ViscosityModel> model, const std::vector<Real>& factors)
      : model_(std::move(model)), factors_(factors) {}
  void evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                std::span<Real> slope) const override;
  void start_rates(const Mesh& mesh, Real rate, std::span<Real> shear_rate) const override {
    model_->start_rates(mesh, rate, shear_rate);
  }
  Real sensitivity() const override { return model_->sensitivity(); }
  bool is_linear() const override { return model_->is_linear(); }

 private:
  std::unique_ptr<const ViscosityModel> model_;
  const std::vector<Real>& factors_;
};

struct Scene;

/// The thermal part of a case, for a scene whose bodies, tools and pairs are there; declares the temperature and gives
/// it its values at the start; puts the softening on the viscosities. Collective.
void build_thermal_scene(const ForgeCase& forge_case, Scene& scene);

/// Softening factors from the temperature. InputError where one is not positive. Collective.
void update_softening(Scene& scene);

/// Mean temperatures of the bodies [region] by volume [K], then the lowest and the highest of all. Collective.
std::vector<Real> body_temperatures(const Scene& scene);

}  // namespace malleus::forge
