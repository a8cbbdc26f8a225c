#include "inject/front_set.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "mesh/node_regions.hpp"
#include "mesh/space_filling_curve.hpp"
#include "solvers/facet_distance.hpp"

namespace malleus::inject {

FrontSet::FrontSet(Scene& scene) : scene_(scene) {
  const InjectCase& settings = scene.settings;
  for (int fluid = 0; fluid < static_cast<int>(settings.fluids.size()); ++fluid) {
    if (fluid != settings.initial_fluid()) fluids_.push_back(fluid);
  }
  for (const int fluid : fluids_) {
    names_.push_back(fluids_.size() == 1 ? "level_set"
                                         : "level_set_" + settings.fluids[static_cast<std::size_t>(fluid)].name);
    scene.fields.declare(scene.mesh, {names_.back(), "m", Support::node, 1, Transfer::interpolate, false});
  }
  seals_.assign(settings.vents.size(), 0);
}

std::vector<FluidLevelSet> FrontSet::level_sets() const {
  std::vector<FluidLevelSet> sets;
  for (std::size_t i = 0; i < size(); ++i) sets.push_back({fluids_[i], values(i)});
  return sets;
}

std::vector<Real> FrontSet::behind_inlets(int fluid) const {
  std::vector<DistanceFacet> facets;
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::inlet)) {
    if (scene_.settings.fluid_index(scene_.settings.inlets[part->index].fluid) != fluid) continue;
    for (const LocalId f : part->facets) {
      DistanceFacet facet;
      const auto nodes = scene_.mesh.nodes_of_facet(f);
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        std::copy_n(scene_.mesh.point(nodes[i]), scene_.mesh.dim,
                    facet.vertices.data() + i * static_cast<std::size_t>(scene_.mesh.dim));
      }
      for (const LocalId node : nodes) {
        facet.node = node;
        facets.push_back(facet);
      }
    }
  }
  // Without inlet the fluid is nowhere: farther away than any point of the cavity.
  const Box box = bounding_box(scene_.comm, scene_.mesh.coordinates, scene_.mesh.dim);
  Real far = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(scene_.mesh.dim); ++c) far += box.high[c] - box.low[c];
  std::vector<Real> level_set = distance_to_facets(scene_.comm, scene_.mesh, scene_.graph, facets, far);
  for (Real& value : level_set) value = -value;
  return level_set;
}

bool FrontSet::is_filled(LocalId node) const {
  for (std::size_t i = 0; i < size(); ++i) {
    if (values(i)[static_cast<std::size_t>(node)] > 0) return true;
  }
  return false;
}

void FrontSet::choose_seals() {
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::vent)) {
    bool is_reached = false;
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      is_reached = is_reached || (part->normals->holds(node) && is_filled(node));
    }
    is_reached = scene_.comm.any(is_reached);
    const VentSettings::Seals wanted = scene_.settings.vents[part->index].seals;
    seals_[part->index] =
        wanted == VentSettings::Seals::yes || (wanted == VentSettings::Seals::automatic && !is_reached);
  }
}

std::vector<char> FrontSet::sealed_vent_nodes() const {
  const Mesh& mesh = scene_.mesh;
  std::vector<Real> is_open(static_cast<std::size_t>(mesh.nodes()), 0);
  std::vector<char> sealed(is_open.size(), 0);
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::vent)) {
    for (LocalId node = 0; node < mesh.nodes(); ++node) {
      if (seals_[part->index] != 0 && part->normals->holds(node)) sealed[static_cast<std::size_t>(node)] = 1;
    }
    for (const LocalId facet : part->facets) {
      const auto nodes = mesh.nodes_of_facet(facet);
      if (std::all_of(nodes.begin(), nodes.end(), [&](LocalId node) { return is_filled(node); })) continue;
      for (const LocalId node : nodes) is_open[static_cast<std::size_t>(node)] = 1;
    }
  }
  mesh.node_halo.max_to_owners(is_open, 1);
  mesh.node_halo.update_copies(is_open, 1);
  for (std::size_t n = 0; n < sealed.size(); ++n) {
    if (is_open[n] > 0) sealed[n] = 0;
  }
  return sealed;
}

bool FrontSet::is_near_open_vent(Real distance) const {
  bool is_near = false;
  for (const BoundaryPart* part : scene_.parts_of(BoundaryPart::Kind::vent)) {
    if (seals_[part->index] == 0) continue;
    for (LocalId node = 0; node < scene_.mesh.nodes(); ++node) {
      if (!part->normals->holds(node) || is_filled(node)) continue;
      for (std::size_t i = 0; i < size(); ++i) {
        is_near = is_near || values(i)[static_cast<std::size_t>(node)] > -distance;
      }
    }
  }
  return scene_.comm.any(is_near);
}

/// Flow goes from element to element through nodes that can move: the regions of such nodes that inlets reach; of
/// all, where there is no inlet.
std::vector<char> FrontSet::reached_by_flow(const std::vector<char>& held) const {
  const Mesh& mesh = scene_.mesh;
  std::vector<LocalId> moving;
  const NodeRegions regions = connected_regions(scene_.comm, mesh, [&](LocalId element) {
    moving.clear();
    for (const LocalId node : mesh.nodes_of_element(element)) {
      if (held[static_cast<std::size_t>(node)] == 0) moving.push_back(node);
    }
    return std::span<const LocalId>(moving);
  });
  const std::vector<const BoundaryPart*> inlets = scene_.parts_of(BoundaryPart::Kind::inlet);
  std::vector<char> reached(held.size(), 1);
  if (inlets.empty() || !regions.is_complete) return reached;
  std::vector<Real> has_inlet(static_cast<std::size_t>(regions.count), 0);
  for (const BoundaryPart* part : inlets) {
    for (std::size_t n = 0; n < held.size(); ++n) {
      const std::int32_t region = regions.of_node[n];
      if (region >= 0 && part->normals->holds(static_cast<LocalId>(n))) has_inlet[static_cast<std::size_t>(region)] = 1;
    }
  }
  scene_.comm.max_in_place(std::span(has_inlet));
  for (std::size_t n = 0; n < held.size(); ++n) {
    const std::int32_t region = regions.of_node[n];
    reached[n] = region >= 0 && has_inlet[static_cast<std::size_t>(region)] > 0;
  }
  return reached;
}

std::vector<char> FrontSet::ways_out() const {
  std::vector<char> held = sealed_vent_nodes();
  const std::vector<char> walls = sticking_walls(scene_);
  for (std::size_t n = 0; n < held.size(); ++n) held[n] = held[n] != 0 || walls[n] != 0;
  const std::vector<char> reached = reached_by_flow(held);
  std::vector<char> open(held.size(), 0);
  for (const BoundaryPart& part : scene_.parts) {
    if (!scene_.is_opening(part)) continue;
    for (std::size_t n = 0; n < held.size(); ++n) {
      if (part.normals->holds(static_cast<LocalId>(n)) && held[n] == 0 && reached[n] != 0) open[n] = 1;
    }
  }
  return open;
}

bool FrontSet::has_way_out() const {
  const std::vector<char> open = ways_out();
  return scene_.comm.any(std::any_of(open.begin(), open.end(), [](char is_open) { return is_open != 0; }));
}

std::vector<Real> FrontSet::united() const {
  std::vector<Real> largest(static_cast<std::size_t>(scene_.mesh.nodes()), std::numeric_limits<Real>::lowest());
  for (std::size_t i = 0; i < size(); ++i) {
    const std::span<const Real> level_set = values(i);
    for (std::size_t n = 0; n < largest.size(); ++n) largest[n] = std::max(largest[n], level_set[n]);
  }
  return largest;
}

bool FrontSet::part() {
  bool any = false;
  for (LocalId n = 0; n < scene_.mesh.nodes(); ++n) {
    const auto node = static_cast<std::size_t>(n);
    std::size_t first = 0;
    std::size_t second = size();
    for (std::size_t i = 1; i < size(); ++i) {
      if (values(i)[node] > values(first)[node]) {
        second = std::exchange(first, i);
      } else if (second == size() || values(i)[node] > values(second)[node]) {
        second = i;
      }
    }
    if (second == size() || !(values(second)[node] > 0)) continue;
    const Real half = (values(first)[node] - values(second)[node]) / 2;
    values(first)[node] = half;
    values(second)[node] = -half;
    any = true;
  }
  return scene_.comm.any(any);
}

void FrontSet::set_initial() {
  for (std::size_t i = 0; i < size(); ++i) {
    const std::vector<Real> at_gate = behind_inlets(fluids_[i]);
    std::copy(at_gate.begin(), at_gate.end(), values(i).begin());
    for (const InitialShape& shape : scene_.settings.shapes) {
      if (scene_.settings.fluid_index(shape.fluid) != fluids_[i]) continue;
      for (LocalId n = 0; n < scene_.mesh.nodes(); ++n) {
        std::array<Real, 3> place = {0, 0, 0};
        std::copy_n(scene_.mesh.point(n), scene_.mesh.dim, place.begin());
        Real& value = values(i)[static_cast<std::size_t>(n)];
        value = std::max(value, shape.signed_distance(place, scene_.mesh.dim));
      }
    }
  }
  if (scene_.settings.time.increments != 0) choose_seals();
}

}  // namespace malleus::inject
