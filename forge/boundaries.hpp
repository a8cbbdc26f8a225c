#pragma once

/// What the case imposes on boundaries and bodies, as constraints and loads of the Stokes equations.

#include <string>
#include <vector>

#include "case/scene_sections.hpp"
#include "fem/boundary_conditions.hpp"
#include "fem/stokes_operator.hpp"

namespace malleus::forge {

/// Bodies that do not deform, and forces on those that do.
struct BodyLoads {
  std::vector<char> is_rigid;                ///< [region]
  std::vector<std::array<Real, 3>> gravity;  ///< [region] density times acceleration, N/m^3; empty: none
  std::vector<Expression> force;             ///< x, y, z, N/m^3; empty: none
};

class Boundaries {
 public:
  /// The settings' groups exist. Geometry: in axisymmetric scenes nodes at x = 0 keep to the axis.
  Boundaries(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::vector<BoundarySettings> settings,
             BodyLoads loads);

  /// To be called when the mesh was changed. Collective.
  void mesh_changed();

  /// The constraints at a time [s], alike on all holders of a node. Where boundaries meet, velocities win over
  /// symmetry. A rigid body moves with the velocity imposed on its boundary; without one it rests. Collective.
  NodeConstraints constraints(Real time) const;
  /// Tractions, pressures and body forces at a time [s]. Collective.
  StokesLoads loads(Real time) const;

  const std::vector<BoundarySettings>& settings() const noexcept { return settings_; }
  /// [group + 1] whether tools and bodies may touch it: no velocity and no symmetry is imposed there.
  const std::vector<char>& is_free() const noexcept { return is_free_; }
  /// Nodes on settings()[i], owned and copies, increasing. Local.
  const std::vector<LocalId>& nodes(std::size_t i) const { return nodes_[i]; }
  bool has_loads() const;
  /// The largest velocity imposed at a time [m/s]. Collective.
  Real largest_speed(Real time) const;
  /// Mean of the velocity imposed on settings()[i] at a time [m/s]; free components are 0. Collective.
  std::array<Real, 3> mean_velocity(std::size_t i, Real time) const;
  /// Force on what imposes settings()[i], from reactions [owned node][dim] on the material [N]: the components that are
  /// imposed by it, at nodes where no earlier boundary imposes them. Collective.
  std::array<Real, 3> force(std::size_t i, std::span<const Real> reactions) const;
  /// Whether anything of a region is held by a velocity or a symmetry. Collective.
  bool is_held(std::int32_t region) const;

 private:
  std::vector<LocalId> nodes_of(std::size_t boundary) const;
  void add_velocities(std::size_t boundary, std::int32_t region, Real time, std::array<Real, 4>& sums) const;
  void add_rigid_bodies(NodeConstraints& constraints, Real time) const;
  std::array<Real, 3> velocity_at(std::size_t boundary, const Real* point, Real time) const;
  int group_of(std::size_t boundary) const { return mesh_->find_group(settings_[boundary].group); }

  const Communicator* comm_;
  const Mesh* mesh_;
  Geometry geometry_;
  std::vector<BoundarySettings> settings_;
  BodyLoads body_loads_;
  std::vector<char> is_free_;
  std::vector<std::vector<LocalId>> nodes_;  ///< [boundary] held nodes on it, owned and copies, increasing
  std::vector<std::int32_t> node_body_;      ///< [local node] region
};

}  // namespace malleus::forge
