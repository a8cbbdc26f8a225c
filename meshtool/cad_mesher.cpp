#include <fmt/format.h>
#include <gmsh.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "meshtool/cad_mesher.hpp"

namespace malleus::meshtool {
namespace {

using Refusal = std::runtime_error;  ///< for the program, which knows errors by its own types

/// gmsh lives from construction to destruction.
class GmshSession {
 public:
  GmshSession() {
    gmsh::initialize();
    gmsh::option::setNumber("General.Terminal", 0);
    constexpr double throw_exception = 2;
    gmsh::option::setNumber("General.AbortOnError", throw_exception);
  }
  GmshSession(const GmshSession&) = delete;
  GmshSession& operator=(const GmshSession&) = delete;
  ~GmshSession() { gmsh::finalize(); }
};

using Entities = std::vector<std::pair<int, int>>;  ///< (dimension, tag)

Entities entities_of(int dim) {
  Entities entities;
  gmsh::model::getEntities(entities, dim);
  return entities;
}

int model_dimension(const std::string& path) {
  if (!entities_of(3).empty()) return 3;
  if (!entities_of(2).empty()) return 2;
  throw Refusal(fmt::format("{}: the CAD file has neither volumes nor surfaces", path));
}

/// One group of all entities of a dimension where the file has none of that dimension.
void name_where_unnamed(int dim, const char* name) {
  Entities groups;
  gmsh::model::getPhysicalGroups(groups, dim);
  if (!groups.empty()) return;
  std::vector<int> tags;
  for (const auto& [entity_dim, tag] : entities_of(dim)) tags.push_back(tag);
  gmsh::model::setPhysicalName(dim, gmsh::model::addPhysicalGroup(dim, tags), name);
}

/// The lines or surfaces that bound the model: those of one entity of the next dimension.
void name_boundary_where_unnamed(int dim, const char* name) {
  Entities groups;
  gmsh::model::getPhysicalGroups(groups, dim - 1);
  if (!groups.empty()) return;
  Entities boundary;
  gmsh::model::getBoundary(entities_of(dim), boundary, true, false);
  std::vector<int> tags;
  for (const auto& [entity_dim, tag] : boundary) tags.push_back(std::abs(tag));
  if (!tags.empty()) gmsh::model::setPhysicalName(dim - 1, gmsh::model::addPhysicalGroup(dim - 1, tags), name);
}

void generate(const std::string& path, Real size) {
  gmsh::open(path);
  const int dim = model_dimension(path);
  name_where_unnamed(dim, dim == 3 ? "volume" : "surface");
  name_boundary_where_unnamed(dim, dim == 3 ? "surface" : "boundary");
  gmsh::option::setNumber("Mesh.MeshSizeMin", size);
  gmsh::option::setNumber("Mesh.MeshSizeMax", size);
  gmsh::option::setNumber("Mesh.ElementOrder", 1);
  gmsh::option::setNumber("Mesh.RecombineAll", 0);
  gmsh::model::mesh::generate(dim);
}

void take_nodes(Real length_unit, MeshChunk& chunk) {
  std::vector<std::size_t> tags;
  std::vector<double> points;
  std::vector<double> parameters;
  gmsh::model::mesh::getNodes(tags, points, parameters, -1, -1, false, false);
  chunk.node_numbers.assign(tags.begin(), tags.end());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (static_cast<int>(i % 3) < chunk.dim) chunk.coordinates.push_back(points[i] * length_unit);
  }
}

/// Simplices of the physical groups of one dimension; an entity belongs to the first of its groups.
struct TakenElements {
  std::vector<std::string> names;
  std::vector<GlobalId> nodes;
  std::vector<std::int32_t> group;
};

TakenElements take_elements(int dim, const std::string& path) {
  constexpr std::array simplex_types = {15, 1, 2, 4};
  TakenElements taken;
  for (const auto& [entity_dim, entity] : entities_of(dim)) {
    std::vector<int> physicals;
    gmsh::model::getPhysicalGroupsForEntity(dim, entity, physicals);
    if (physicals.empty()) continue;
    std::string name;
    gmsh::model::getPhysicalName(dim, physicals.front(), name);
    if (name.empty()) name = std::to_string(physicals.front());
    const auto known = std::find(taken.names.begin(), taken.names.end(), name);
    const auto group = static_cast<std::int32_t>(known - taken.names.begin());
    if (known == taken.names.end()) taken.names.push_back(name);
    std::vector<int> types;
    std::vector<std::vector<std::size_t>> numbers;
    std::vector<std::vector<std::size_t>> nodes;
    gmsh::model::mesh::getElements(types, numbers, nodes, dim, entity);
    for (std::size_t t = 0; t < types.size(); ++t) {
      if (types[t] != simplex_types[static_cast<std::size_t>(dim)]) {
        throw Refusal(fmt::format("{}: gmsh made elements that are no triangles or tetrahedra", path));
      }
      taken.nodes.insert(taken.nodes.end(), nodes[t].begin(), nodes[t].end());
      taken.group.insert(taken.group.end(), numbers[t].size(), group);
    }
  }
  return taken;
}

void mesh_file(const std::string& path, Real size, Real length_unit, MeshChunk& chunk) {
  const GmshSession session;
  try {
    generate(path, size);
  } catch (const std::string& reason) {
    throw Refusal(fmt::format("{}: gmsh cannot mesh it: {}", path, reason));
  }
  chunk.dim = model_dimension(path);
  take_nodes(length_unit, chunk);
  TakenElements elements = take_elements(chunk.dim, path);
  TakenElements facets = take_elements(chunk.dim - 1, path);
  if (elements.group.empty()) throw Refusal(fmt::format("{}: gmsh made no elements of it", path));
  chunk.region_names = elements.names;
  chunk.element_nodes = std::move(elements.nodes);
  chunk.element_region = std::move(elements.group);
  for (std::size_t e = 0; e < chunk.element_region.size(); ++e) chunk.element_ids.push_back(static_cast<GlobalId>(e));
  chunk.group_names = facets.names;
  chunk.facet_nodes = std::move(facets.nodes);
  chunk.facet_group = std::move(facets.group);
}

}  // namespace

std::string mesh_cad(const std::string& path, Real size, Real length_unit, MeshChunk& chunk) {
  try {
    mesh_file(path, size, length_unit, chunk);
  } catch (const std::exception& reason) {
    return reason.what();
  }
  return {};
}

}  // namespace malleus::meshtool

malleus::meshtool::CadMesher* malleus_cad_mesher() {
  return malleus::meshtool::mesh_cad;
}
