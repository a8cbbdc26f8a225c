#pragma once

/// Remeshing of some of a rank's elements, while the others, and all that other ranks hold too, stay as they are.

#include <span>

#include "field/field.hpp"
#include "remesh/remesh.hpp"

namespace malleus {

/// The node field that carries a metric that varies: 1 component [m] for sizes, dim (dim + 1) / 2 [1/m^2] for tensors.
inline constexpr const char* metric_field_name = "remeshing_metric";

/// Puts a metric of the mesh's nodes into the store, so that migrations and remeshes carry it along; a uniform one
/// needs no field. Local.
void store_metric(const Mesh& mesh, const Metric& metric, FieldStore& fields);
/// The metric in the store, at the nodes of the mesh in local order; `uniform` where it holds none. Local.
Metric stored_metric(const Mesh& mesh, const FieldStore& fields, const Metric& uniform);

/// Nodes that other ranks hold, too: [node] 1 or 0. Local.
std::vector<std::uint8_t> shared_nodes(const Mesh& mesh);

/// The local elements of a mesh as the remesher's input, nodes in the same order, nodes of other ranks frozen; exterior
/// facets listed, inner ones with a group, too. Local.
RemeshMesh local_arrays(const Mesh& mesh);

/// Brings the elements with selected[element] != 0 to the metric (see stored_metric) and puts the new mesh in place of
/// the old one; fields follow: nodes' values by interpolation, elements' values as their spec says. Nodes of other
/// ranks, and of elements not selected, keep their place; the faces between them stay. Global numbers and the order of
/// elements change, element_ids end. The report is this rank's. Collective; the remeshing itself is local.
RemeshReport remesh_selection(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                              std::span<const std::uint8_t> selected, const Metric& uniform,
                              const RemeshOptions& options);

}  // namespace malleus
