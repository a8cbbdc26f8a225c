#include "inject/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/error.hpp"
#include "base/log.hpp"
#include "fem/level_set_volume.hpp"
#include "solvers/level_set_speed.hpp"

namespace malleus::inject {
namespace {

/// A part without facets for each section that names a group.
std::vector<BoundaryPart> named_parts(const InjectCase& settings) {
  std::vector<BoundaryPart> parts;
  const auto add = [&](BoundaryPart::Kind kind, const char* title, const auto& sections) {
    for (std::size_t i = 0; i < sections.size(); ++i) {
      BoundaryPart& part = parts.emplace_back();
      part.kind = kind;
      part.index = i;
      part.section = std::string(title) + "." + sections[i].name;
    }
  };
  add(BoundaryPart::Kind::wall, "wall", settings.walls);
  add(BoundaryPart::Kind::inlet, "inlet", settings.inlets);
  add(BoundaryPart::Kind::vent, "vent", settings.vents);
  add(BoundaryPart::Kind::symmetry, "symmetry", settings.symmetries);
  add(BoundaryPart::Kind::imposed, "boundary", settings.common.boundaries);
  return parts;
}

const std::string& group_of(const InjectCase& settings, const BoundaryPart& part) {
  switch (part.kind) {
    case BoundaryPart::Kind::wall:
      return settings.walls[part.index].group;
    case BoundaryPart::Kind::inlet:
      return settings.inlets[part.index].group;
    case BoundaryPart::Kind::vent:
      return settings.vents[part.index].group;
    case BoundaryPart::Kind::symmetry:
      return settings.symmetries[part.index].group;
    case BoundaryPart::Kind::imposed:
      break;
  }
  return settings.common.boundaries[part.index].group;
}

/// Index of the part of each group, -1 = none.
std::vector<int> parts_of_groups(const Mesh& mesh, const std::vector<BoundaryPart>& parts) {
  std::vector<int> part_of_group(mesh.group_names.size(), -1);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    int& part = part_of_group[static_cast<std::size_t>(parts[p].group)];
    if (part >= 0) {
      throw InputError(fmt::format("[{}] group: '{}' is the group of [{}] already", parts[p].section,
                                   mesh.group_names[static_cast<std::size_t>(parts[p].group)],
                                   parts[static_cast<std::size_t>(part)].section));
    }
    part = static_cast<int>(p);
  }
  return part_of_group;
}

/// [exterior facet] whether it lies on the axis of an axisymmetric scene, to rounding of the mesh file's coordinates.
std::vector<char> facets_on_axis(const Mesh& mesh, Geometry geometry) {
  std::vector<char> on_axis(static_cast<std::size_t>(mesh.exterior_facets), 0);
  if (geometry != Geometry::axisymmetric) return on_axis;
  Real largest = 0;
  for (LocalId node = 0; node < mesh.nodes(); ++node) largest = std::max(largest, std::abs(mesh.point(node)[0]));
  for (LocalId f = 0; f < mesh.exterior_facets; ++f) {
    const auto nodes = mesh.nodes_of_facet(f);
    on_axis[static_cast<std::size_t>(f)] = std::all_of(
        nodes.begin(), nodes.end(), [&](LocalId node) { return std::abs(mesh.point(node)[0]) <= 1e-10 * largest; });
  }
  return on_axis;
}

/// Names what lies on the boundary, and not on the axis, without a section. Collective.
void refuse_unnamed(const Communicator& comm, const Mesh& mesh, const std::vector<int>& part_of_group,
                    std::span<const char> on_axis) {
  std::vector<GlobalId> counts(mesh.group_names.size() + 1, 0);  // last: facets without a group
  for (LocalId f = 0; f < mesh.exterior_facets; ++f) {
    if (on_axis[static_cast<std::size_t>(f)] != 0) continue;
    const std::int32_t group = mesh.facet_group[static_cast<std::size_t>(f)];
    if (group < 0) ++counts.back();
    if (group >= 0 && part_of_group[static_cast<std::size_t>(group)] < 0) ++counts[static_cast<std::size_t>(group)];
  }
  comm.sum_in_place(counts);
  std::string names;
  for (std::size_t g = 0; g < mesh.group_names.size(); ++g) {
    if (counts[g] > 0) names += fmt::format("{}'{}'", names.empty() ? "" : ", ", mesh.group_names[g]);
  }
  if (!names.empty()) {
    throw InputError(fmt::format(
        "the boundary groups {} have no section: name each in [wall.NAME], [inlet.NAME], [vent.NAME], [symmetry.NAME] "
        "or [boundary.NAME]",
        names));
  }
  if (counts.back() > 0) {
    throw InputError(fmt::format(
        "{} facets of the boundary belong to no physical group of the mesh: give them one, and a section in the case",
        counts.back()));
  }
}

}  // namespace

Scene::Scene(const Communicator& communicator, Mesh first_mesh, const InjectCase& filling_case)
    : comm(communicator),
      settings(filling_case),
      mesh(std::move(first_mesh)),
      geometry(filling_case.common.case_settings.geometry == CaseGeometry::axisymmetric ? Geometry::axisymmetric
                                                                                        : Geometry::plane) {
  rebuild();
}

void Scene::rebuild() {
  graph = build_node_graph(mesh);
  measures = element_measures(mesh, geometry == Geometry::axisymmetric);
  cavity = comm.sum(std::accumulate(measures.begin(), measures.end(), 0.0));
  const std::vector<Real> flat = element_measures(mesh, false);
  const Real mean = comm.sum(std::accumulate(flat.begin(), flat.end(), 0.0)) /
                    static_cast<Real>(std::max<GlobalId>(1, mesh.total_elements));
  element_size = mesh.dim == 2 ? std::sqrt(4 / std::sqrt(3.0) * mean) : std::cbrt(6 * std::sqrt(2.0) * mean);
  node_sizes = malleus::node_sizes(mesh);
  parts = named_parts(settings);
  for (BoundaryPart& part : parts) part.group = mesh.find_group(group_of(settings, part));
  const std::vector<int> part_of_group = parts_of_groups(mesh, parts);
  const std::vector<char> on_axis = facets_on_axis(mesh, geometry);
  if (!settings.flow.is_prescribed()) refuse_unnamed(comm, mesh, part_of_group, on_axis);
  for (BoundaryPart& part : parts) {
    part.facets = facets_of_group(mesh, part.group);
    part.normals.emplace(mesh, part.group, geometry);
    part.area = boundary_area(comm, mesh, geometry, part.facets);
    const bool is_axis = std::all_of(part.facets.begin(), part.facets.end(),
                                     [&](LocalId f) { return on_axis[static_cast<std::size_t>(f)] != 0; });
    const bool exists = comm.any(!part.facets.empty());
    if (part.area > 0 || (exists && part.kind == BoundaryPart::Kind::symmetry)) continue;
    if (exists && comm.all(is_axis)) {
      throw InputError(
          fmt::format("[{}] group: '{}' is the axis, through which nothing passes; leave it without a section",
                      part.section, group_of(settings, part)));
    }
    throw InputError(fmt::format("[{}] group: no facet of '{}' lies on the boundary of the mesh", part.section,
                                 group_of(settings, part)));
  }
}

bool Scene::is_opening(const BoundaryPart& part) const {
  if (part.kind != BoundaryPart::Kind::imposed) return part.kind == BoundaryPart::Kind::vent;
  return settings.common.boundaries[part.index].type != BoundarySettings::Type::symmetry;
}

std::vector<const BoundaryPart*> Scene::parts_of(BoundaryPart::Kind kind) const {
  std::vector<const BoundaryPart*> found;
  for (const BoundaryPart& part : parts) {
    if (part.kind == kind) found.push_back(&part);
  }
  return found;
}

Real outflow(const Scene& scene, std::span<const LocalId> facets, std::span<const Real> velocity) {
  return boundary_flux(scene.comm, scene.mesh, scene.geometry, facets, velocity, scene.mesh.dim);
}

std::vector<char> sticking_walls(const Scene& scene) {
  std::vector<char> sticks(static_cast<std::size_t>(scene.mesh.nodes()), 0);
  for (const BoundaryPart* part : scene.parts_of(BoundaryPart::Kind::wall)) {
    if (scene.settings.walls[part->index].condition != WallSettings::Condition::no_slip) continue;
    for (LocalId node = 0; node < scene.mesh.nodes(); ++node) {
      if (part->normals->holds(node)) sticks[static_cast<std::size_t>(node)] = 1;
    }
  }
  return sticks;
}

Real surface_mean(const Scene& scene, const BoundaryPart& part, std::span<const Real> field) {
  Real sum = 0;
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId f : part.facets) {
      const auto shares = facet_integrals<D>(scene.mesh, f, scene.geometry).shares();
      for (int i = 0; i < D; ++i) {
        sum += shares[i] * field[static_cast<std::size_t>(scene.mesh.nodes_of_facet(f)[static_cast<std::size_t>(i)])];
      }
    }
  });
  return scene.comm.sum(sum) / part.area;
}

}  // namespace malleus::inject
