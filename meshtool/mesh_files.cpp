#include "meshtool/mesh_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "base/error.hpp"
#include "base/text.hpp"
#include "engine/load_mesh.hpp"
#include "mesh/medit_mesh.hpp"
#include "mesh/msh_reader.hpp"
#include "storage/mesh_file.hpp"

namespace malleus::meshtool {
namespace {

const std::vector<std::string> endings = {".msh", ".h5", ".mesh", ".meshb"};

std::string ending_of(const std::string& path) {
  return std::filesystem::path(path).extension().string();
}

bool is_medit(const std::string& path) {
  return ending_of(path) == ".mesh" || ending_of(path) == ".meshb";
}

/// An assembled mesh as loose pieces.
MeshChunk chunk_of(const Communicator& comm, const Mesh& mesh, const std::string& source) {
  MeshChunk chunk;
  chunk.source = source;
  chunk.dim = mesh.dim;
  chunk.region_names = mesh.region_names;
  chunk.group_names = mesh.group_names;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) chunk.node_numbers.push_back(mesh.global_node(node));
  chunk.coordinates.assign(mesh.coordinates.begin(),
                           mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(mesh.owned_nodes()) * mesh.dim);
  for (const LocalId node : mesh.element_nodes) chunk.element_nodes.push_back(mesh.global_node(node));
  chunk.element_region = mesh.element_region;
  chunk.element_ids.resize(chunk.element_region.size());
  std::iota(chunk.element_ids.begin(), chunk.element_ids.end(), comm.sum_of_lower_ranks(GlobalId{mesh.elements()}));
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    const std::int32_t group = mesh.facet_group[static_cast<std::size_t>(f)];
    if (group < 0) continue;
    for (const LocalId node : mesh.nodes_of_facet(f)) chunk.facet_nodes.push_back(mesh.global_node(node));
    chunk.facet_group.push_back(group);
  }
  return chunk;
}

}  // namespace

std::string mesh_endings() {
  return join(endings);
}

void refuse_unknown_ending(const std::string& path) {
  if (std::find(endings.begin(), endings.end(), ending_of(path)) != endings.end()) return;
  throw InputError(fmt::format("{}: a mesh file ends in {}", path, mesh_endings()));
}

Mesh read_mesh(const Communicator& comm, const std::string& path, Real length_unit, FieldStore& fields, Folds folds) {
  refuse_unknown_ending(path);
  return load_mesh(comm, path, length_unit, fields, folds);
}

MeshChunk read_chunk(const Communicator& comm, const std::string& path, Real length_unit) {
  refuse_unknown_ending(path);
  if (is_medit(path)) return read_medit_mesh(comm, path, length_unit);
  if (ending_of(path) == ".msh") return read_msh(comm, path, length_unit);
  FieldStore fields;
  return chunk_of(comm, load_mesh(comm, path, length_unit, fields), path);
}

void write_mesh(const Communicator& comm, const Mesh& mesh, const FieldStore& fields, const std::string& path,
                MshFormat msh) {
  refuse_unknown_ending(path);
  if (is_medit(path)) return write_medit_mesh(comm, mesh, path);
  if (ending_of(path) == ".msh") return write_msh(comm, mesh, path, msh);
  write_mesh_file(comm, path, mesh, fields);
}

}  // namespace malleus::meshtool
