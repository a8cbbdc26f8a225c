#pragma once

/// The distance of the solution from a known one.

#include <nlohmann/json.hpp>

#include "engine/component.hpp"
#include "forge/contact_flow.hpp"

namespace malleus::forge {

/// Errors of velocity and pressure against [reference], on the mesh that they were solved on, at the time of the solve.
/// Stands after the flow and before the motion. With at = end an increment only keeps where the mesh was.
class KnownErrors final : public Component {
 public:
  KnownErrors(Scene& scene, const ContactFlow& flow, const ReferenceSettings& reference)
      : scene_(scene), flow_(flow), reference_(reference) {}
  std::string name() const override { return "errors"; }
  std::string purpose() const override { return "distance from the known solution"; }
  FieldUse uses() const override { return {{field_name::velocity, field_name::pressure}, {}, {}}; }
  Outcome advance(const Increment& increment) override;
  Outcome solve_once() override { return advance({0, 0, 0}); }

  /// velocity_l2, velocity_h1, pressure_l2 and their ..._relative, of the last solve. Collective.
  const nlohmann::json& errors();
  /// With at = every: names of the absolute errors, as in errors(), for history.csv.
  std::vector<std::string> columns() const;

 private:
  void compute();

  Scene& scene_;
  const ContactFlow& flow_;
  const ReferenceSettings& reference_;
  std::vector<Real> coordinates_;  ///< of the last solve
  bool is_due_ = false;            ///< its errors are not computed yet
  Real time_ = 0;                  ///< of the last solve, s
  nlohmann::json errors_ = nlohmann::json::object();
};

}  // namespace malleus::forge
