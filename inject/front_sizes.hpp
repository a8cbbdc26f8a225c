#pragma once

/// Element sizes that follow the fronts, for remeshing.

#include "inject/front_set.hpp"
#include "remesh/metric.hpp"

namespace malleus::inject {

/// Makes a metric finer about the fronts: no size above [remesh] min_size within front_band of them, beyond it growing
/// with the distance by the gradation; with `anisotropic` only across the front. Nothing where min_size is not given.
/// Collective.
void refine_at_fronts(const Scene& scene, const FrontSet& fronts, Metric& metric);

/// Whether a front has come to elements that are much larger than min_size. Collective.
bool front_left_fine_elements(const Scene& scene, const FrontSet& fronts);

}  // namespace malleus::inject
