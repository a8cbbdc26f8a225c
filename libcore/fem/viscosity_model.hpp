#pragma once

/// The viscosity of every element of the mesh.

#include <algorithm>
#include <memory>
#include <vector>

#include "material/viscous_law.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// Gives each element its viscosity from its shear rate; one value an element. Bodies, fluids and mixtures are models.
class ViscosityModel {
 public:
  virtual ~ViscosityModel() = default;
  /// shear_rate: [element] sqrt(2 eps:eps), 1/s. viscosity: Pa.s, 0 = the element is not modelled. slope:
  /// (d eta / d gamma) / gamma, Pa.s^3. Local.
  virtual void evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                        std::span<Real> slope) const = 0;
  /// The rates [element] at which a first solve takes the viscosities, where nothing is known but a rate of the scene.
  virtual void start_rates(const Mesh& mesh, Real rate, std::span<Real> shear_rate) const {
    (void)mesh;
    std::fill(shear_rate.begin(), shear_rate.end(), rate);
  }
  /// The smallest of the laws' (see ViscousLaw). The same on all ranks.
  virtual Real sensitivity() const = 0;
  /// No element's viscosity depends on its shear rate. The same on all ranks.
  virtual bool is_linear() const = 0;
};

/// A law a region of the mesh; none = the region is not modelled (a rigid body).
class RegionViscosity final : public ViscosityModel {
 public:
  explicit RegionViscosity(std::vector<std::unique_ptr<const ViscousLaw>> laws) : laws_(std::move(laws)) {}
  void evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                std::span<Real> slope) const override;
  /// The softest region has the rate, the others the rate at which they bear its stress: Newton's method would not find
  /// soon that a stiff one hardly moves.
  void start_rates(const Mesh& mesh, Real rate, std::span<Real> shear_rate) const override;
  Real sensitivity() const override;
  bool is_linear() const override;

 private:
  std::vector<std::unique_ptr<const ViscousLaw>> laws_;  ///< [region]
};

/// Viscosities that do not depend on the flow (an expression of space at the centroids).
class GivenViscosity final : public ViscosityModel {
 public:
  explicit GivenViscosity(std::vector<Real> viscosity) : viscosity_(std::move(viscosity)) {}
  void evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                std::span<Real> slope) const override;
  Real sensitivity() const override { return 1; }
  bool is_linear() const override { return true; }

 private:
  std::vector<Real> viscosity_;  ///< [element]
};

}  // namespace malleus
