#pragma once

/// Sections of both programs that say what is modelled: loads, heat, boundaries, probes and known solutions.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "case/schema.hpp"

namespace malleus {

/// A component a formula; without value: free, or not given.
using ExpressionVector = std::array<std::optional<Expression>, 3>;

/// [gravity]
struct GravitySettings {
  std::array<Real, 3> acceleration = {};  ///< m/s^2; the third is 0 in 2D

  void describe(Section& s);
};

/// [inertia]: its presence adds the inertia terms.
struct InertiaSettings {
  void describe(Section&) {}
};

/// [thermal]: its presence adds the heat equation. Bodies, fluids, tools and walls give their own constants.
struct ThermalSettings {
  Expression initial = Expression(293.15);  ///< K
  Real ambient = 293.15;                    ///< K, around free surfaces
  Real emissivity = 0;                      ///< of free surfaces
  Real convection = 0;                      ///< W/(m^2 K), from free surfaces to the surroundings
  Real dissipation = 1;                     ///< Taylor-Quinney: share of the power of deformation that becomes heat

  void describe(Section& s);
};

enum class TrappedAir { gas, vented };

/// [air]
struct AirSettings {
  TrappedAir trapped = TrappedAir::gas;
  Real pressure = 101325;  ///< Pa, absolute, before compression

  void describe(Section& s);
};

/// [body_force]: force per volume, N/m^3.
struct BodyForceSettings {
  std::array<Expression, 3> force;

  void describe(Section& s);
};

enum class ReferenceTime { end, every };

/// [reference]: a known solution; the run computes its errors against what is given.
struct ReferenceSettings {
  ExpressionVector velocity;            ///< m/s
  std::optional<Expression> pressure;   ///< Pa
  std::optional<Expression> level_set;  ///< m, positive inside
  ReferenceTime at = ReferenceTime::end;

  void describe(Section& s);
  void validate(Section& s) const;
};

enum class ProbeMotion { fixed, with_material };

/// [probe.NAME]: points at which fields are recorded. Either a file of points or one point.
struct ProbeSettings {
  std::string name;
  std::filesystem::path file;
  std::optional<std::array<Real, 3>> point;  ///< m
  std::vector<std::string> fields;           ///< empty: all that the scene has
  ProbeMotion motion = ProbeMotion::fixed;

  void describe(Section& s);
  void validate(Section& s) const;
};

/// [initial]: inject adds `fluid` (derive, and call this describe()).
struct InitialSettings {
  std::filesystem::path from;  ///< output directory of another run; empty: none

  void describe(Section& s);
};

/// [boundary.NAME]: what is imposed on a physical surface (a curve in 2D). A velocity leaves its free components to the
/// traction and pressure given with it; symmetry excludes all others.
struct BoundarySettings {
  enum class Type { imposed, symmetry };

  std::string name;
  std::string group;
  Type type = Type::imposed;
  std::optional<std::array<std::optional<Real>, 3>> velocity;  ///< m/s
  ExpressionVector velocity_components;                        ///< m/s
  std::optional<std::array<Real, 3>> traction;                 ///< Pa
  ExpressionVector traction_components;                        ///< Pa
  std::optional<Expression> pressure;                          ///< Pa, pressing on the body
  std::optional<Expression> temperature;                       ///< K, imposed
  std::optional<Expression> heat_flux;                         ///< W/m^2, into the material

  void describe(Section& s);
  void validate(Section& s) const;

  /// Of either form; components without value are free.
  ExpressionVector imposed_velocity() const;
  bool has_velocity() const;
  /// Of either form; 0 where nothing is given. The pressure comes on top, along the normal.
  std::array<Expression, 3> imposed_traction() const;
  bool has_traction() const;
  bool has_heat() const { return temperature || heat_flux; }

 private:
  void refuse_two_causes(Section& s) const;
};

}  // namespace malleus
