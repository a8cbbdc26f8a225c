#pragma once

/// The distributed mesh: simplices of one dimension, each element on exactly one rank.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/types.hpp"
#include "parallel/communicator.hpp"
#include "parallel/halo.hpp"

namespace malleus {

/// Triangles (dim 2) or tetrahedra (dim 3). Every element belongs to one rank. A node is held by each rank that has an
/// element at it and owned by one of them; locally owned nodes come first, [0, owned_nodes()), then copies. Global
/// node numbers are contiguous by rank: an owned node's is node_ownership.begin() + local. Elements and nodes are in
/// the order of a space-filling curve. A rank may hold nothing. Built by assemble_mesh(); only `coordinates` may be
/// changed afterwards, alike on all holders of a node.
struct Mesh {
  int dim = 3;
  std::vector<std::string> region_names;  ///< volume groups (surface groups in 2D), same on all ranks
  std::vector<std::string> group_names;   ///< boundary groups, same on all ranks

  std::vector<Real> coordinates;  ///< [node][dim], m
  Ownership node_ownership;
  std::vector<GlobalId> copy_numbers;  ///< global numbers of the copies, increasing
  Halo node_halo;

  std::vector<LocalId> element_nodes;        ///< [element][dim+1], positive orientation
  std::vector<std::int32_t> element_region;  ///< index in region_names
  std::vector<GlobalId> element_ids;         ///< place in the input file, kept through migration; empty after a remesh
  GlobalId total_elements = 0;

  /// Exterior facets of this rank's elements, [0, exterior_facets), then inner facets that carry a group.
  /// Oriented so that the normal points out of facet_element.
  std::vector<LocalId> facet_nodes;  ///< [facet][dim]
  std::vector<LocalId> facet_element;
  std::vector<std::int32_t> facet_group;  ///< index in group_names; -1 = unnamed
  LocalId exterior_facets = 0;

  LocalId owned_nodes() const noexcept { return node_halo.owned(); }
  LocalId nodes() const noexcept { return static_cast<LocalId>(coordinates.size() / static_cast<std::size_t>(dim)); }
  LocalId elements() const noexcept { return static_cast<LocalId>(element_region.size()); }
  LocalId facets() const noexcept { return static_cast<LocalId>(facet_group.size()); }
  GlobalId total_nodes() const noexcept { return node_ownership.total(); }
  GlobalId global_node(LocalId node) const noexcept {
    return node < owned_nodes() ? node_ownership.begin() + node
                                : copy_numbers[static_cast<std::size_t>(node - owned_nodes())];
  }

  std::span<const LocalId> nodes_of_element(LocalId element) const {
    const auto n = static_cast<std::size_t>(dim) + 1;
    return {element_nodes.data() + static_cast<std::size_t>(element) * n, n};
  }
  std::span<const LocalId> nodes_of_facet(LocalId facet) const {
    const auto n = static_cast<std::size_t>(dim);
    return {facet_nodes.data() + static_cast<std::size_t>(facet) * n, n};
  }
  const Real* point(LocalId node) const { return coordinates.data() + static_cast<std::size_t>(node) * dim; }
  Real* point(LocalId node) { return coordinates.data() + static_cast<std::size_t>(node) * dim; }

  /// Index of a name in region_names (group_names), -1 where there is none. Local.
  int find_region(const std::string& name) const;
  int find_group(const std::string& name) const;
};

}  // namespace malleus
