#pragma once

/// The level sets of a scene: one for each fluid but the one that the cavity held at the start.

#include <string>
#include <vector>

#include "inject/mixture.hpp"
#include "inject/scene.hpp"

namespace malleus::inject {

/// Names and values of the level-set fields. A scene of one fluid has none.
class FrontSet {
 public:
  explicit FrontSet(Scene& scene);

  std::size_t size() const { return fluids_.size(); }
  int fluid(std::size_t i) const { return fluids_[i]; }
  const std::string& field_name(std::size_t i) const { return names_[i]; }
  std::span<Real> values(std::size_t i) { return scene_.fields[names_[i]].values(); }
  std::span<const Real> values(std::size_t i) const { return scene_.fields[names_[i]].values(); }
  std::vector<FluidLevelSet> level_sets() const;
  const std::vector<std::string>& names() const { return names_; }

  /// Level sets at the start: the shapes of the case; else the front of a fluid stands at its inlets. Collective.
  void set_initial();

 private:
  std::vector<Real> behind_inlets(int fluid) const;

  Scene& scene_;
  std::vector<int> fluids_;
  std::vector<std::string> names_;
};

}  // namespace malleus::inject
