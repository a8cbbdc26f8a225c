#include "forge/state_json.hpp"

namespace malleus::forge {

nlohmann::json press_json(const PressState& state) {
  return {{"stroke", state.stroke},
          {"speed", state.speed},
          {"last_speed", state.last_speed},
          {"last_force", state.last_force},
          {"allowed_speed", state.allowed_speed},
          {"stopped", state.stopped}};
}

PressState press_state(const nlohmann::json& json) {
  PressState state;
  state.stroke = json.at("stroke");
  state.speed = json.at("speed");
  state.last_speed = json.at("last_speed");
  state.last_force = json.at("last_force");
  state.allowed_speed = json.at("allowed_speed");
  state.stopped = json.at("stopped");
  return state;
}

nlohmann::json heat_json(const HeatTotals& totals) {
  return {{"stored_J", totals.stored},
          {"dissipated_J", totals.dissipated},
          {"friction_J", totals.friction},
          {"imposed_J", totals.imposed},
          {"lost_J", totals.lost}};
}

HeatTotals heat_totals(const nlohmann::json& json) {
  return {json.at("stored_J"), json.at("dissipated_J"), json.at("friction_J"), json.at("imposed_J"), json.at("lost_J")};
}

nlohmann::json work_json(const WorkBalance& work) {
  return {{"imposed_J", work.imposed},
          {"tools_J", work.tools},
          {"deformation_J", work.deformation},
          {"contact_J", work.contact}};
}

WorkBalance work_of(const nlohmann::json& json) {
  return {json.at("imposed_J"), json.at("tools_J"), json.at("deformation_J"), json.at("contact_J")};
}

}  // namespace malleus::forge
