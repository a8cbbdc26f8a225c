#pragma once

/// Text files with a number per element, one a line, in the order of the elements in the mesh file.

#include <span>
#include <string>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus::meshtool {

/// The numbers of this rank's elements. The ranks read a stretch of the file each. InputError where a line is no
/// number, or there are not as many as elements. Collective.
std::vector<Real> read_element_list(const Communicator& comm, const Mesh& mesh, const std::string& path);

/// values: [element]. Elements that the mesh file repeats and the mesh leaves out get -1. StorageError. Collective.
void write_element_list(const Communicator& comm, const Mesh& mesh, const std::string& path,
                        std::span<const int> values);

}  // namespace malleus::meshtool
