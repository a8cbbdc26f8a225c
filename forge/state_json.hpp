#pragma once

/// What checkpoints keep of presses, heat and work, as JSON and back. Local.

#include <nlohmann/json.hpp>

#include "forge/contact_flow.hpp"
#include "forge/heat.hpp"
#include "forge/press.hpp"

namespace malleus::forge {

nlohmann::json press_json(const PressState& state);
PressState press_state(const nlohmann::json& json);
nlohmann::json heat_json(const HeatTotals& totals);
HeatTotals heat_totals(const nlohmann::json& json);
nlohmann::json work_json(const WorkBalance& work);
WorkBalance work_of(const nlohmann::json& json);

}  // namespace malleus::forge
