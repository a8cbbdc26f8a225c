#pragma once

/// What a filling is expected to take, before it runs.

#include "engine/process.hpp"
#include "inject/front_set.hpp"

namespace malleus::inject {

/// The way [m] that the fronts of a scene have before them: from where they stand to the farthest node. Collective.
Real way_of_fronts(const Scene& scene, const FrontSet& fronts);

/// Increments: the front crosses the elements of its way, and an increment a stride of them; more where it starts
/// faster than it goes on, less where [time] end comes before the cavity is full. Times and memory from measured
/// constants of one core. way: of way_of_fronts(), 0 without fronts. solves_flow: false where the case prescribes it.
/// Collective.
Forecast forecast_filling(const Scene& scene, Real way, Real stride, bool solves_flow, bool is_linear);

}  // namespace malleus::inject
