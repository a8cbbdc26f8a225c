#pragma once

/// What a filling case may say: the sections of inject beside those that both programs share.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "case/common_sections.hpp"
#include "fem/transport_element.hpp"

namespace malleus::inject {

/// [fluid.NAME]
struct FluidSettings {
  enum class Law { newtonian, power_law, carreau_yasuda, cross, empty };

  std::string name;
  Law law = Law::newtonian;
  std::optional<Expression> viscosity;  ///< Pa.s; of the fluid at rest for carreau-yasuda and cross
  std::optional<Real> consistency;      ///< Pa.s^n
  Real exponent = 1;                    ///< n
  Real infinite_viscosity = 0;          ///< Pa.s
  std::optional<Real> time_constant;    ///< s
  Real transition = 2;                  ///< a of Carreau-Yasuda
  std::optional<Real> density;          ///< kg/m^3

  void describe(Section& s);
  void validate(Section& s) const;
  /// Viscosity [Pa.s] by which fluids are compared: at rest, or at a shear rate of 1/s for the power law.
  Real reference_viscosity() const;
};

/// [initial]
struct InitialFluid : InitialSettings {
  std::string fluid;

  void describe(Section& s);
};

/// [initial.NAME]: where else a fluid is at the start.
struct InitialShape {
  enum class Shape { sphere, box, half_space };

  std::string name;
  std::string fluid;
  std::optional<Shape> shape;
  std::optional<std::array<Real, 3>> center;
  std::optional<std::array<Real, 3>> size;
  std::optional<Real> radius;
  std::optional<std::array<Real, 3>> point;
  std::optional<std::array<Real, 3>> normal;
  std::optional<Expression> level_set;  ///< m, positive inside

  void describe(Section& s);
  void validate(Section& s) const;
  Real signed_distance(const std::array<Real, 3>& at, int dim) const;  ///< positive inside
};

/// A velocity at a gate: a speed along the inward normal, or a vector.
struct GateVelocity {
  std::optional<Expression> speed;  ///< m/s, inward
  ExpressionVector vector;          ///< m/s
};

/// [inlet.NAME]
struct InletSettings {
  std::string name;
  std::string group;
  std::string fluid;
  std::optional<GateVelocity> velocity;
  ExpressionVector velocity_components;
  std::optional<Expression> flow_rate;  ///< m^3/s into the cavity (per metre of depth in plane scenes)
  std::optional<Expression> pressure;   ///< Pa
  std::optional<Real> switch_pressure;  ///< Pa
  std::optional<Real> switch_fill;      ///< fill fraction
  std::optional<Real> then_pressure;    ///< Pa

  void describe(Section& s);
  void validate(Section& s) const;
  bool has_velocity() const;
  bool depends_on_time() const;  ///< what it asks for
  bool switches() const { return switch_pressure || switch_fill; }
};

/// [vent.NAME]
struct VentSettings {
  enum class Seals { automatic, yes, no };

  std::string name;
  std::string group;
  Expression pressure = Expression(0);  ///< Pa
  Seals seals = Seals::automatic;

  void describe(Section& s);
};

/// [wall.NAME]
struct WallSettings {
  enum class Condition { no_slip, slip };

  std::string name;
  std::string group;
  Condition condition = Condition::no_slip;
  std::string only;  ///< fluid that sticks while the others slip; empty = all stick

  void describe(Section& s);
  void validate(Section& s) const;
};

/// [symmetry.NAME]
struct SymmetrySettings {
  std::string name;
  std::string group;

  void describe(Section& s);
};

enum class MixtureLaw { fraction, heaviside, sharp, harmonic };

/// [front]
struct FrontSettings {
  enum class Transport { crank_nicolson, residual_free_bubbles, trace };
  enum class Redistance { on_demand, never };

  MixtureLaw mixture = MixtureLaw::fraction;
  Real thickness = 1;  ///< elements
  Transport transport = Transport::crank_nicolson;
  Redistance redistance = Redistance::on_demand;
  std::optional<Real> narrow_band;  ///< elements
  Real cfl = 0.5;
  std::optional<Real> contrast;  ///< largest ratio of viscosities

  void describe(Section& s);
  Stabilization stabilization() const;
};

/// When the flow is solved again.
struct FlowUpdate {
  enum class Kind { once, every, automatic };
  Kind kind = Kind::automatic;
  int every = 1;  ///< increments
};

/// [flow]
struct FlowSettings {
  FlowUpdate update;
  Real update_distance = 1;     ///< elements
  ExpressionVector prescribed;  ///< m/s

  void describe(Section& s);
  bool is_prescribed() const;
};

/// All of a case file of inject.
struct InjectCase {
  CommonSections common;
  TimeSettings time;
  std::vector<FluidSettings> fluids;
  std::optional<InitialFluid> initial;
  std::vector<InitialShape> shapes;
  std::vector<InletSettings> inlets;
  std::vector<VentSettings> vents;
  std::vector<WallSettings> walls;
  std::vector<SymmetrySettings> symmetries;
  FrontSettings front;
  FlowSettings flow;

  void describe(CaseReader& reader);
  /// Mistakes between sections. To be called before reader.finish().
  void check(CaseReader& reader) const;

  void check_inertia(CaseReader& reader) const;
  void check_trace(CaseReader& reader) const;
  int fluid_index(const std::string& name) const;  ///< in `fluids`, -1 = none
  bool is_driven() const;                          ///< something can move the fluids
  int initial_fluid() const;                       ///< what fills the cavity at the start
};

}  // namespace malleus::inject
