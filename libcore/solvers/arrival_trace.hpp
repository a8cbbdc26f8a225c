#pragma once

/// When a front that goes with a steady flow arrives: each node traced back along its streamline, once.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// A label that a steady flow carries is constant along streamlines: the front passes a node as long after the start
/// as the way back to where it started takes. This replaces the transport steps of a flow that is solved once: nothing
/// is diffused, and the front is known at all times. velocity: [node][dim], m/s, linear in elements; start: [node]
/// level set at the start, positive where the fluid is. Returns [node], s, the same on all holders: 0 where the fluid
/// is, infinity where the way back leads through no such place (nodes at rest, flow in circles, other inlets). Steps
/// are a quarter of an element by the midpoint rule; those who reach another rank's elements are handed over. What the
/// fluid has once reached counts as filled. Collective.
std::vector<Real> arrival_times(const Communicator& comm, const Mesh& mesh, std::span<const Real> velocity,
                                std::span<const Real> start);

}  // namespace malleus
