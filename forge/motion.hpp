#pragma once

/// The mesh follows the material.

#include "engine/component.hpp"
#include "forge/contact_flow.hpp"

namespace malleus::forge {

/// x += dt times the velocity that the time scheme gives for the step; the equivalent strain likewise. An increment
/// that turns an element over, changes an edge by more than the set share or a volume by more than half a hundredth is
/// given up for a shorter one. Ends the increment of the presses.
class Motion final : public Component {
 public:
  Motion(Scene& scene, const ContactFlow& flow) : scene_(scene), flow_(flow) {}

  std::string name() const override { return "motion"; }
  std::string purpose() const override;
  FieldUse uses() const override { return {{field_name::velocity}, {field_name::equivalent_strain}, {}}; }
  Outcome advance(const Increment& increment) override;
  void roll_back() override;

 private:
  Outcome check_edges(Real dt) const;
  Outcome move(Real dt);
  void integrate_strain(Real dt);
  Outcome check_volumes();
  void account_volume();
  void warn_of_loss();
  void account_strokes(const Increment& increment);

  Scene& scene_;
  const ContactFlow& flow_;
  std::vector<Real> saved_coordinates_;
  std::vector<Real> saved_strain_;
  std::vector<Body> saved_bodies_;
  Progress saved_progress_;
  bool has_warned_ = false;  ///< of lost volume
};

/// Smallest quality of the elements of deformable bodies. Collective.
Real smallest_quality(const Scene& scene);

}  // namespace malleus::forge
