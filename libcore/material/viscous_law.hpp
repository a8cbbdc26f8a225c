#pragma once

/// Generalised Newtonian laws: the viscosity as a function of the shear rate.

#include <algorithm>
#include <memory>
#include <span>

#include "base/types.hpp"

namespace malleus {

/// Stress deviator = 2 eta(gamma) eps with the shear rate gamma = sqrt(2 eps:eps) [1/s] = sqrt(3) times the equivalent
/// strain rate sqrt(2/3 eps:eps). Virtual per batch of elements, not per element.
class ViscousLaw {
 public:
  virtual ~ViscousLaw() = default;
  /// For each shear rate >= 0: the viscosity eta [Pa.s], and slope = (d eta / d gamma) / gamma [Pa.s^3], which stays
  /// finite at rest. All spans have one length. Local.
  virtual void evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const = 0;
  /// A lower bound of d ln(tau) / d ln(gamma), tau = eta gamma, at most 1: m for Norton-Hoff.
  virtual Real sensitivity() const = 0;
  /// The viscosity does not depend on the shear rate.
  virtual bool is_linear() const { return false; }
};

/// eta constant. viscosity [Pa.s] > 0.
class NewtonianLaw final : public ViscousLaw {
 public:
  explicit NewtonianLaw(Real viscosity) : viscosity_(viscosity) {}
  void evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const override;
  Real sensitivity() const override { return 1; }
  bool is_linear() const override { return true; }

 private:
  Real viscosity_;
};

/// Norton-Hoff and power law: eta = K (gamma^2 + gamma_0^2)^((m-1)/2), that is K (sqrt(3) e)^(m-1) with the equivalent
/// strain rate e, and a smooth cut-off gamma_0 below which the material is Newtonian.
struct NortonHoff {
  Real consistency = 1;  ///< K, Pa.s^m, > 0
  Real sensitivity = 1;  ///< m, > 0 (n of the power law; above 1 the material shear-thickens)
  Real cut_off = 0;      ///< gamma_0, 1/s, >= 0; > 0 where m < 1
};
class NortonHoffLaw final : public ViscousLaw {
 public:
  explicit NortonHoffLaw(const NortonHoff& constants) : constants_(constants) {}
  void evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const override;
  Real sensitivity() const override { return std::min<Real>(1, constants_.sensitivity); }
  bool is_linear() const override { return constants_.sensitivity == 1; }

 private:
  NortonHoff constants_;
};

/// Carreau-Yasuda: eta = eta_inf + (eta_0 - eta_inf) (1 + (lambda gamma)^a)^((n-1)/a) (Yasuda 1979; a = 2: Carreau
/// 1972).
struct CarreauYasuda {
  Real zero_viscosity = 1;      ///< eta_0, Pa.s, > 0
  Real infinite_viscosity = 0;  ///< eta_inf, Pa.s, >= 0
  Real time = 1;                ///< lambda, s, > 0
  Real exponent = 1;            ///< n, > 0
  Real transition = 2;          ///< a, > 0
};
class CarreauYasudaLaw final : public ViscousLaw {
 public:
  explicit CarreauYasudaLaw(const CarreauYasuda& constants) : constants_(constants) {}
  void evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const override;
  Real sensitivity() const override { return std::min<Real>(1, constants_.exponent); }

 private:
  CarreauYasuda constants_;
};

/// Cross: eta = eta_inf + (eta_0 - eta_inf) / (1 + (lambda gamma)^(1-n)) (Cross 1965).
struct Cross {
  Real zero_viscosity = 1;      ///< eta_0, Pa.s, > 0
  Real infinite_viscosity = 0;  ///< eta_inf, Pa.s, >= 0
  Real time = 1;                ///< lambda, s, > 0
  Real exponent = 0.5;          ///< n, 0 < n < 1
};
class CrossLaw final : public ViscousLaw {
 public:
  explicit CrossLaw(const Cross& constants) : constants_(constants) {}
  void evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const override;
  Real sensitivity() const override { return std::min<Real>(1, constants_.exponent); }

 private:
  Cross constants_;
};

/// Another law's viscosity kept in [low, high]; constant, slope 0, outside.
class ClampedLaw final : public ViscousLaw {
 public:
  ClampedLaw(std::unique_ptr<const ViscousLaw> law, Real low, Real high)
      : law_(std::move(law)), low_(low), high_(high) {}
  void evaluate(std::span<const Real> shear_rate, std::span<Real> viscosity, std::span<Real> slope) const override;
  Real sensitivity() const override { return law_->sensitivity(); }
  bool is_linear() const override { return law_->is_linear(); }

 private:
  std::unique_ptr<const ViscousLaw> law_;
  Real low_;
  Real high_;
};

}  // namespace malleus
