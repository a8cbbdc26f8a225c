#pragma once

/// Pressures where nothing is modelled, for what is looked at.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// [node] 1 where some element of a viscosity touches it, on any rank. element_viscosity: [element] Pa.s. Collective.
std::vector<char> modelled_nodes(const Mesh& mesh, std::span<const Real> element_viscosity);

/// Gives the nodes that touch no modelled element (viscosity > 0) the mean of their nearest neighbours that do, layer
/// by layer, at most 64 layers, each with what the force between them adds (grad p = f: exact at rest); nodes beyond
/// keep their values. element_viscosity: [element]. element_force: [element][dim], N/m^3; empty = none. pressure:
/// [node], owned and copies up to date, as on return. Collective.
void extend_pressure(const Communicator& comm, const Mesh& mesh, std::span<const Real> element_viscosity,
                     std::span<const Real> element_force, std::span<Real> pressure);

}  // namespace malleus
