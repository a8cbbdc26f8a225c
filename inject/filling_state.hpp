#pragma once

/// What the components of a filling tell each other beside the fields; the same on all ranks.

#include <string>
#include <vector>

#include "base/types.hpp"
#include "inject/flow_conditions.hpp"

namespace malleus::inject {

/// An inlet as the flow of the increment has it.
struct GateState {
  GateDrive drive;
  Real pressure = 0;      ///< Pa: the unknown of a flow-rate gate, else the mean over the area
  Real flow = 0;          ///< m^3/s into the cavity
  bool switched = false;  ///< then_pressure has taken over
};

/// Volumes in m^3 (per metre of depth in plane scenes). "Filled": by any fluid but the one that the cavity held.
struct FillingState {
  std::vector<GateState> gates;  ///< [inlet]
  Real time = 0;                 ///< end of the last increment, s
  Real initial = 0;              ///< filled at the start
  Real injected = 0;             ///< through the inlets since
  Real left = 0;                 ///< of the filled, through vents and boundaries
  Real filled_at_flow = 0;       ///< filled when the flow was last solved
  Real filled = 0;
  Real travelled = 0;         ///< elements that the front moved since the flow was solved
  bool flow_updated = false;  ///< in this increment
  bool is_closed = false;     ///< every vent is sealed, and nothing else lets fluid out
  GlobalId flow_solves = 0;
  GlobalId increments_since_flow = 0;
  Real seconds_since_flow = 0;

  Real inflow() const {
    Real sum = 0;
    for (const GateState& gate : gates) sum += gate.flow;
    return sum;
  }
};

}  // namespace malleus::inject
