#pragma once

/// Velocities ahead of a front, where no flow is solved.

#include <functional>
#include <span>

#include "mesh/mesh.hpp"

namespace malleus {

/// Gives nodes without a velocity that of the front, carried on along the level set's gradient (grad alpha . grad v =
/// 0): layer by layer, a node takes the mean of its neighbours that have one, weighted by the square of the level set's
/// slope toward them (Adalsteinsson, Sethian 1999 march the same equation). Each velocity is handed to `constrain`
/// (node, velocity [dim]), which may hold it on walls. is_known: [node] 1 or 0; velocity: [node][dim] m/s; level_set:
/// [node] m, falling away from the known side; all alike on all holders, as on return. Collective.
void extend_velocity(const Communicator& comm, const Mesh& mesh, std::span<const char> is_known,
                     std::span<const Real> level_set, const std::function<void(LocalId, Real*)>& constrain,
                     std::span<Real> velocity);

}  // namespace malleus
