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
  const std::vector<char>& seals() const { return seals_; }  ///< [vent]: whether it closes where a fluid arrives
  void set_seals(std::vector<char> seals) { seals_ = std::move(seals); }

  /// Nodes of vents that a filling fluid has closed, in that it covers every facet of the vent at the node: [node],
  /// alike on all holders. Collective.
  std::vector<char> sealed_vent_nodes() const;
  /// Whether a front is within a distance [m] of a part of a vent that it will close. Collective.
  bool is_near_open_vent(Real distance) const;
  /// Nodes through which fluid can leave: of vents that are not closed there and of boundaries that the case moves,
  /// where the flow from the inlets reaches them through nodes that can move (sections one element thin let nothing
  /// through): [node]. Collective.
  std::vector<char> ways_out() const;
  /// Whether air, or a fluid under a given pressure, can still leave or enter. Collective.
  bool has_way_out() const;

  /// [node] the largest of the level sets: positive where some fluid has come. Local.
  std::vector<Real> united() const;

  /// Where two fluids claim a node, the one with the larger level set keeps it: both take half the difference, with
  /// opposite signs, so that their fronts meet half-way (Merriman, Bence, Osher 1994). Returns whether there were any.
  /// Collective.
  bool part();

  /// Level sets at the start: the shapes of the case; else the front of a fluid stands at its inlets. Collective.
  void set_initial();

 private:
  std::vector<Real> behind_inlets(int fluid) const;
  bool is_filled(LocalId node) const;
  void choose_seals();
  std::vector<char> reached_by_flow(const std::vector<char>& held) const;

  Scene& scene_;
  std::vector<int> fluids_;
  std::vector<std::string> names_;
  std::vector<char> seals_;  ///< [vent]
};

}  // namespace malleus::inject
