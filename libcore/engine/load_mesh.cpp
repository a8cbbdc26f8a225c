#include "engine/load_mesh.hpp"

#include <fmt/format.h>

#include "base/error.hpp"
#include "mesh/medit_mesh.hpp"
#include "mesh/msh_reader.hpp"
#include "partition/balance.hpp"
#include "storage/mesh_file.hpp"

namespace malleus {

namespace {

Mesh read_any(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields) {
  const std::string ending = path.extension().string();
  if (ending == ".msh") return build_mesh(comm, read_msh(comm, path.string(), length_unit));
  if (ending == ".mesh" || ending == ".meshb") {
    return build_mesh(comm, read_medit_mesh(comm, path.string(), length_unit));
  }
  if (ending == ".h5") {
    Mesh mesh = read_mesh_file(comm, path, length_unit, fields);
    balance_along_curve(comm, mesh, fields);
    return mesh;
  }
  throw InputError(
      fmt::format("{}: meshes are read from .msh, .h5, .mesh and .meshb files (meshtool convert makes them from CAD)",
                  path.string()));
}

}  // namespace

Mesh load_mesh(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields) {
  Mesh mesh = read_any(comm, path, length_unit, fields);
  if (mesh.total_elements == 0) throw InputError(fmt::format("{}: holds no elements", path.string()));
  return mesh;
}

}  // namespace malleus
