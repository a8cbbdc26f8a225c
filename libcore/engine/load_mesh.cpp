#include "engine/load_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "base/error.hpp"
#include "base/log.hpp"
#include "mesh/medit_mesh.hpp"
#include "mesh/msh_reader.hpp"
#include "mesh/soundness.hpp"
#include "partition/balance.hpp"
#include "storage/mesh_file.hpp"

namespace malleus {

namespace {

/// Without these a mesh covers its domain once, without gaps, and a field on it is continuous.
bool is_fatal(const MeshProblem& problem, Folds folds) {
  if (problem.kind == "folds") return folds == Folds::refuse;
  constexpr std::array<std::string_view, 4> fatal = {"crowded faces", "hanging nodes", "flat elements", "loose facets"};
  return std::find(fatal.begin(), fatal.end(), problem.kind) != fatal.end();
}

/// Assembles a mesh on which equations can be solved; InputError for any other, warnings for what is merely odd.
Mesh build_sound_mesh(const Communicator& comm, MeshChunk chunk, Folds folds) {
  const std::string source = chunk.source;
  const DistributedPiece distributed = distribute_mesh(comm, std::move(chunk));
  std::vector<std::string> fatal;
  for (const MeshProblem& problem : find_problems(comm, distributed)) {
    if (is_fatal(problem, folds)) fatal.push_back(problem.message);
    const bool is_odd = problem.is_fault && problem.kind != "untagged boundary";
    if (!is_fatal(problem, folds) && is_odd) log::warning("{}: {}", source, problem.message);
  }
  if (!fatal.empty()) {
    throw InputError(fmt::format("{}: the mesh is not sound: {}; see meshtool check", source, fmt::join(fatal, "; ")));
  }
  return assemble_mesh(comm, distributed.piece).mesh;
}

Mesh read_any(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields,
              Folds folds) {
  const std::string ending = path.extension().string();
  if (ending == ".msh") return build_sound_mesh(comm, read_msh(comm, path.string(), length_unit), folds);
  if (ending == ".mesh" || ending == ".meshb") {
    return build_sound_mesh(comm, read_medit_mesh(comm, path.string(), length_unit), folds);
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

Mesh load_mesh(const Communicator& comm, const std::filesystem::path& path, Real length_unit, FieldStore& fields,
               Folds folds) {
  Mesh mesh = read_any(comm, path, length_unit, fields, folds);
  if (mesh.total_elements == 0) throw InputError(fmt::format("{}: holds no elements", path.string()));
  return mesh;
}

}  // namespace malleus
