#pragma once

/// What an increment's solution tells of its own error in the forces.

#include <nlohmann/json.hpp>

#include "forge/contact_flow.hpp"
#include "forge/scene.hpp"

namespace malleus::forge {

/// Relative errors of the forces, by source; root mean squares over the increments where they are a run's.
struct ForceErrors {
  Real contact = 0;    ///< of speeds, by what the penalty lets through: m times its share of the power
  Real cut_off = 0;    ///< by viscosities below those of the laws: mean by the elements' power
  Real returned = 0;   ///< by the flow that gives the volume back that the motion lost
  Real nonlinear = 0;  ///< residual that Newton's method stopped at
  Real balance = 0;    ///< half of what is left over of all forces
};

/// Root mean squares, over the increments so far.
class ForceErrorSums {
 public:
  void add(const ForceErrors& increment);
  ForceErrors mean() const;  ///< zero before the first increment
  nlohmann::json save() const;
  void restore(const nlohmann::json& saved);

 private:
  ForceErrors squares_;
  Real increments_ = 0;
};

/// Of the last solve, whose step was dt [s]. A body that is pressed by F = A stress, in which a share d of the strain
/// goes into volume, resists less by m d / 3. Collective.
ForceErrors increment_errors(const Scene& scene, const FlowReport& report, Real dt);

}  // namespace malleus::forge
