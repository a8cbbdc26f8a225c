#pragma once

/// From the flat arrays to the working mesh and back: orientation, patches, curves, classes of vertices.

#include "remesh/working_mesh.hpp"

namespace malleus::remeshing {

/// What building found out about the input.
struct BuildNotes {
  LocalId unmatched_facets = 0;  ///< listed facets that are no element's face; dropped
  LocalId reoriented = 0;        ///< elements whose vertex order disagreed with their neighbours'
  LocalId unused_nodes = 0;      ///< nodes without elements; dropped
};

/// Elements, points, neighbours and regions; elements of a face-connected body get one orientation, that of positive
/// total volume. Throws InputError for a face of more than two elements. metrics are left empty.
template <int D, class Metric>
void build_elements(const RemeshMesh& input, WorkingMesh<D, Metric>& mesh, BuildNotes& notes);

/// Patches, curves and the classes of the vertices. An edge between two faces is a feature where their groups differ,
/// where it is listed as a curve, where more or fewer than two faces meet, and where they bend by more than
/// feature_angle [rad]; a vertex is a corner where features end, branch, or bend by more than it.
template <int D, class Metric>
void classify(const RemeshMesh& input, Real feature_angle, WorkingMesh<D, Metric>& mesh, BuildNotes& notes);

/// The mesh back in flat arrays. The mesh must have no free slots (after renumber).
template <int D, class Metric>
RemeshMesh to_arrays(const WorkingMesh<D, Metric>& mesh);

}  // namespace malleus::remeshing
