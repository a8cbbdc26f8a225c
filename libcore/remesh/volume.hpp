#pragma once

/// Volumes of regions, and their restoration where a curved surface was resampled.

#include "remesh/working_mesh.hpp"

namespace malleus::remeshing {

/// Signed volume of each region [m^D], by its index in mesh.regions.
template <int D, class Metric>
std::vector<Real> region_volumes(const WorkingMesh<D, Metric>& mesh);

/// Brings each region to its target volume by one shift, the same for all, of the vertices inside its curved exterior
/// patches along their normals (Newton's method on the exact volume). Corners, curves, flat patches, flat parts of
/// curved ones (a tool presses there), interfaces and frozen vertices stay. Returns the largest relative error left;
/// regions without such a patch keep theirs.
template <int D, class Metric>
Real restore_volumes(WorkingMesh<D, Metric>& mesh, const std::vector<Real>& targets);

}  // namespace malleus::remeshing
