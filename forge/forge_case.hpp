#pragma once

/// The sections of a forging case.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "case/common_sections.hpp"
#include "forge/friction.hpp"
#include "forge/press.hpp"
#include "forge/time_scheme.hpp"
#include "forge/tool_shape.hpp"

namespace malleus::forge {

/// Between surfaces under pressure, where the case gives nothing else, W/(m^2 K).
inline constexpr Real default_heat_transfer = 1e4;

enum class BodyLaw { norton_hoff, newtonian, rigid };

/// [body.NAME]
struct BodySettings {
  std::string name;
  std::string group;
  BodyLaw law = BodyLaw::norton_hoff;
  std::optional<Real> consistency;  ///< K, Pa.s^m
  Real rate_sensitivity = 1;        ///< m
  std::optional<Real> viscosity;    ///< newtonian, Pa.s
  std::optional<Real> density;      ///< kg/m^3
  bool remesh = true;               ///< with [remesh]: its mesh is made anew with the others
  // With [thermal]:
  std::optional<Real> conductivity;       ///< W/(m K)
  std::optional<Real> heat_capacity;      ///< J/(kg K)
  std::optional<Expression> temperature;  ///< K, at the start
  std::optional<Expression> softening;    ///< of T: what the consistency is multiplied with

  void describe(Section& s);
  void validate(Section& s) const;
  Real coefficient() const { return viscosity ? *viscosity : consistency.value_or(0); }  ///< K, Pa.s^m
};

/// The friction keys that tools and contacts share.
struct FrictionSettings {
  Real coefficient = 0;
  Real exponent = 1;
  FrictionLaw law = FrictionLaw::norton;

  void describe(Section& s);
  void validate(Section& s) const;
  FrictionSpec spec() const { return {law, coefficient, exponent}; }
};

enum class ShapeKind { plane, sphere, cylinder, box, surface };

/// [tool.NAME]
struct ToolSettings {
  std::string name;
  ShapeKind shape = ShapeKind::plane;
  Side side = Side::outside;
  std::array<Real, 3> point = {};               ///< m
  std::optional<std::array<Real, 3>> normal;    ///< plane
  std::optional<std::array<Real, 3>> axis;      ///< cylinder
  std::optional<Real> radius;                   ///< sphere, cylinder, m
  std::optional<Real> length;                   ///< cylinder, m
  std::optional<std::array<Real, 3>> size;      ///< box, m
  std::filesystem::path file;                   ///< surface
  std::string length_unit = "m";                ///< of the surface's file
  std::optional<std::array<Real, 3>> velocity;  ///< m/s
  ExpressionVector velocity_components;         ///< m/s, of t
  std::filesystem::path stroke_file;
  std::optional<std::array<Real, 3>> direction;
  Real spin = 0;  ///< rad/s
  std::optional<std::array<Real, 3>> spin_axis;
  std::optional<std::array<Real, 3>> pivot;
  FrictionSettings friction;
  PressKind press = PressKind::speed;
  std::optional<Real> force_limit;     ///< N
  std::optional<Real> crank_radius;    ///< m
  std::optional<Real> rod_length;      ///< m
  std::optional<Real> rotation_speed;  ///< rad/s
  std::optional<Real> start_height;    ///< m
  std::optional<Real> energy;          ///< J
  std::optional<Real> mass;            ///< kg
  // With [thermal]:
  std::optional<Real> temperature;    ///< K
  std::optional<Real> heat_transfer;  ///< W/(m^2 K)

  void describe(Section& s);
  void validate(Section& s) const;
  bool may_advance() const;    ///< whether a velocity, a table or a press moves it along a direction
  Real surface_scale() const;  ///< m per length_unit; InputError where that is no length

 private:
  void describe_shape(Section& s);
  void describe_motion(Section& s);
  void validate_shape(Section& s) const;
  void refuse_other_shapes(Section& s) const;
  void refuse_other_presses(Section& s) const;
  void validate_motion(Section& s) const;
};

/// [contact.NAME]
struct BodyContactSettings {
  std::string name;
  std::optional<std::string> slave;   ///< none: by the rules
  std::optional<std::string> master;  ///< none: by the rules
  std::vector<std::string> bodies;    ///< the two, where the rules shall choose
  FrictionSettings friction;
  std::optional<Real> penalty;
  Real heat_transfer = default_heat_transfer;  ///< W/(m^2 K), with [thermal]

  void describe(Section& s);
  void validate(Section& s) const;
};

/// [time], with the stroke.
struct ForgeTime : TimeSettings {
  std::optional<Real> stroke;  ///< m

  void describe(Section& s);
};

enum class VolumeTarget { automatic, yes, no };

/// [motion]
struct MotionSettings {
  TimeScheme scheme = TimeScheme::adams_bashforth_2;
  Real edge_share = 0.3;
  std::optional<Real> strain;
  VolumeTarget volume_target = VolumeTarget::automatic;

  void describe(Section& s);
};

/// [penalty]
struct PenaltySettings {
  Real penalty = 1e4;
  bool augmented = false;
  Real penetration = 1e-3;
  Real slip_scale = 1e-3;

  void describe(Section& s);
};

struct ForgeCase {
  CommonSections common;
  ForgeTime time;
  std::vector<BodySettings> bodies;
  std::vector<ToolSettings> tools;
  std::vector<BodyContactSettings> contacts;
  MotionSettings motion;
  PenaltySettings penalty;
  std::optional<InitialSettings> initial;

  void describe(CaseReader& reader);
  /// Rules between sections. Local.
  void validate(CaseReader& reader) const;
  /// Whether some tool or boundary has a stroke.
  bool anything_moves() const;

 private:
  void validate_heat(CaseReader& reader) const;
};

}  // namespace malleus::forge
