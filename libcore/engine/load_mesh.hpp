#pragma once

/// A mesh from a file of any format that the program reads.

#include <filesystem>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// What is done with a mesh that is folded over.
enum class Folds { refuse, keep_for_repair };

/// Reads .msh (gmsh 2.2, 4.1), .mesh or .meshb (Medit) or .h5 (our own), scaled by length_unit [m per unit of the
/// file], in equal shares. The fields of a file of our own come declared in the store. InputError where the ending is
/// unknown, or the file absent or damaged. Collective.
Mesh load_mesh(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields,
               Folds folds = Folds::refuse);

}  // namespace malleus
