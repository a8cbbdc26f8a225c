#pragma once

/// What the case imposes on the flow: walls, gates, vents, symmetry, boundaries, gravity and body force.

#include <optional>
#include <string>
#include <vector>

#include "fem/node_constraints.hpp"
#include "fem/stokes_operator.hpp"
#include "inject/mixture.hpp"
#include "inject/scene.hpp"

namespace malleus::inject {

/// How a gate drives the flow now.
struct GateDrive {
  enum class Kind { velocity, flow_rate, pressure };
  Kind kind = Kind::flow_rate;
  Real value = 0;  ///< m^3/s into the cavity (velocity, flow_rate), or Pa
};

/// Nodes at which walls with `only = FLUID` hold the fluid now: [node].
using StickingNodes = std::vector<char>;

/// Conditions at one time. Gates are the flow-rate inlets, in the order of the case; they are the operator's borders.
struct FlowConditions {
  NodeConstraints constraints;
  StokesLoads loads;
  std::vector<FluxGate> gates;
  std::vector<std::size_t> gate_inlets;  ///< inlet of each gate
};

/// Wall over inlet, inlet over symmetry. Velocity inlets are rescaled so that the discrete flux is drive.value.
/// drives: [inlet]. Throws InputError where a gate has no node that can move, or where an imposed flow has no way out.
/// Collective.
FlowConditions make_conditions(const Scene& scene, const Mixture& mixture, const std::vector<GateDrive>& drives,
                               const StickingNodes& sticking, Real time);

/// What each inlet asks for at that time. Collective.
std::vector<GateDrive> asked_drives(const Scene& scene, Real time);

}  // namespace malleus::inject
