#pragma once

/// What all parts of the filling process share: case, mesh, fields, and which part of the boundary is what.

#include <optional>
#include <string>
#include <vector>

#include "fem/boundary_conditions.hpp"
#include "field/field.hpp"
#include "inject/sections.hpp"
#include "mesh/node_graph.hpp"

namespace malleus::inject {

/// Part of the boundary that one section of the case describes.
struct BoundaryPart {
  enum class Kind { wall, inlet, vent, symmetry, imposed };

  Kind kind = Kind::wall;
  std::size_t index = 0;  ///< in the case's list of that kind
  std::string section;    ///< "inlet.gate", for messages
  int group = -1;
  std::vector<LocalId> facets;  ///< of this rank
  Real area = 0;                ///< m^2 over all ranks (m per metre of depth; whole revolution)
  std::optional<GroupNormals> normals;
};

/// Built once a mesh; everything but the fields is renewed by rebuild() when the mesh was replaced.
struct Scene {
  Scene(const Communicator& communicator, Mesh first_mesh, const InjectCase& filling_case);
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Facets, normals, graph and volumes of the present mesh. InputError where a part of the boundary has no meaning, or
  /// two. Collective.
  void rebuild();

  const Communicator& comm;
  const InjectCase& settings;
  Mesh mesh;
  FieldStore fields;
  Geometry geometry;

  NodeGraph graph;
  std::vector<Real> measures;  ///< volume of each element, m^3
  /// Of the last solved flow, [element][dim], m/s (see StokesOperator); empty where the flow is prescribed.
  std::vector<Real> subscale_velocity;
  Real cavity = 0;               ///< volume of all, m^3
  Real element_size = 0;         ///< edge of a regular element of mean volume, m
  std::vector<Real> node_sizes;  ///< [node] of the mesh around it, m
  std::vector<BoundaryPart> parts;

  std::vector<const BoundaryPart*> parts_of(BoundaryPart::Kind kind) const;
  /// Whether air can go out through a part, or come in: a vent, or a [boundary] that is no symmetry.
  bool is_opening(const BoundaryPart& part) const;
};

/// Flow out through facets [m^3/s] of a velocity field [node][dim]. Collective.
Real outflow(const Scene& scene, std::span<const LocalId> facets, std::span<const Real> velocity);

/// Nodes of no-slip walls, those with `only = FLUID` among them: [node], alike on all holders.
std::vector<char> sticking_walls(const Scene& scene);

/// Mean of a nodal field over facets, weighted by area. Collective.
Real surface_mean(const Scene& scene, const BoundaryPart& part, std::span<const Real> field);

}  // namespace malleus::inject
