#pragma once

/// The start of an operation from the end of another one: [initial] from.

#include <filesystem>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus::forge {

/// Shape and history of the material, dealt in equal shares to the ranks.
struct EarlierState {
  Mesh mesh;
  FieldStore fields;  ///< all that the run had
};

/// The newest complete state under a run's output directory, written on any number of ranks. InputError where there is
/// none, or where it lacks groups or regions that `expected`, the mesh of the case, has. Collective.
EarlierState read_earlier_state(const Communicator& comm, const Mesh& expected, const std::filesystem::path& directory);

/// Gives a scene built on the earlier mesh what the material keeps from operation to operation (the strain that it has
/// had); velocities, contacts, strokes and times start anew. Local.
void take_over(const EarlierState& earlier, FieldStore& fields);

}  // namespace malleus::forge
