#pragma once

/// From conditions on boundary groups to prescribed directions of nodes and tractions on facets.

#include <optional>
#include <span>

#include "case/expression.hpp"
#include "fem/facet.hpp"
#include "fem/node_constraints.hpp"
#include "fem/stokes_operator.hpp"

namespace malleus {

/// Where several conditions meet at a node, the first kind of this list decides, and later ones fix what it leaves.
enum class ConditionKind {
  no_slip,        ///< velocity 0
  velocity,       ///< given components
  no_tangential,  ///< only along the normal: gates and vents
  symmetry        ///< no velocity along the normal: symmetry planes of any orientation, slipping walls
};

/// A condition on the velocities of the nodes of a boundary group.
struct BoundaryCondition {
  std::int32_t group = 0;  ///< index in Mesh::group_names
  ConditionKind kind = ConditionKind::no_slip;
  std::array<std::optional<Expression>, 3> velocity;  ///< m/s, for the kind `velocity`; none = that component is free
};

/// Force on a boundary group.
struct BoundaryLoad {
  std::int32_t group = 0;
  std::array<Expression, 3> traction;  ///< Pa
  std::optional<Expression> pressure;  ///< Pa, pressing on the material; on top of the traction
};

/// Normals of the nodes of a boundary group. Alike on all holders of a node.
class GroupNormals {
 public:
  GroupNormals(const Mesh& mesh, std::int32_t group, Geometry geometry);  ///< collective
  bool holds(LocalId node) const { return rank_[static_cast<std::size_t>(node)] > 0; }
  /// The directions that the group's facets at a node face: one unit normal, the mean weighted by area (with it the
  /// flow through the faces at the node is zero where the velocity is tangential), where they lie flat or curve
  /// gently; an orthonormal basis of two or three directions at edges and corners (facets that differ by more than
  /// about 40 degrees). [count][dim].
  std::span<const Real> directions(LocalId node) const;
  /// The mean normal, outward. [dim].
  std::span<const Real> normal(LocalId node) const;

 private:
  int dim_;
  std::vector<std::int8_t> rank_;  ///< number of directions, 0 = not of the group
  std::vector<Real> frames_;       ///< [node][dim][dim]
  std::vector<Real> normals_;      ///< [node][dim]
};

/// All conditions at one time [s]. In axisymmetric scenes nodes on the axis get v_r = 0. An expression that is not
/// finite at a node is an InputError with the place. Collective.
NodeConstraints make_constraints(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                                 std::span<const BoundaryCondition> conditions, Real time);

/// Tractions of all loads at one time [s]. Errors as above. Collective.
std::vector<FacetTraction> make_tractions(const Communicator& comm, const Mesh& mesh,
                                          std::span<const BoundaryLoad> loads, Real time);

/// Exterior facets of this rank that are of a group. Local.
std::vector<LocalId> facets_of_group(const Mesh& mesh, std::int32_t group);

/// Area of facets [m^2], and the flow of nodal velocities [local node][stride], the first dim of each being v, through
/// them [m^3/s, outward]. Collective.
Real boundary_area(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::span<const LocalId> facets);
Real boundary_flux(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::span<const LocalId> facets,
                   std::span<const Real> velocity, int stride);

}  // namespace malleus
