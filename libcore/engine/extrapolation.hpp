#pragma once

/// What results on coarser meshes tell of the error on the finest.

#include <vector>

#include "base/types.hpp"

namespace malleus {

/// The same results on meshes of growing size: two meshes or three.
struct MeshComparison {
  std::vector<Real> sizes;                 ///< [mesh] mean size over that of the finest: 1 first, growing
  std::vector<std::vector<Real>> results;  ///< [mesh][result]
};

/// Where nothing shows the order in which errors fall with sizes.
inline constexpr Real usual_order = 1.75;

/// Order p in R + C h^p that three meshes show, within [1.5, 2]: an element of second order has it on fine meshes, less
/// where boundary layers are as wide as elements. usual_order where there are two meshes, or where the results go to
/// and fro. A third mesh to which the difference grows faster than by the third power is too coarse to count.
Real observed_order(const MeshComparison& comparison);

/// Relative error on the finest mesh: distance of its results from the fit R + C h^p (of three meshes by least squares,
/// weighted by 1/h^2), with what the fit leaves, for that is how far one mesh differs from another of its size by
/// chance. Sums of absolute values over all results; 0 where all results are 0.
Real extrapolated_error(const MeshComparison& comparison);

}  // namespace malleus
