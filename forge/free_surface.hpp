#pragma once

/// The surface of the bodies on which contact may happen, complete around every node whatever the partition.

#include <cstdint>
#include <span>
#include <vector>

#include "fem/facet.hpp"
#include "forge/facet_tree.hpp"
#include "mesh/mesh.hpp"

namespace malleus::forge {

/// Exterior facets that no boundary condition holds. Each node on them knows all facets around it, also those of other
/// ranks, as shares: a facet's area normal times the part of it that belongs to the node (a third in 3D, half in 2D;
/// weighted with 2 pi r in axisymmetric scenes, where facets on the axis do not count). Valid for the coordinates at
/// construction.
class FreeSurface {
 public:
  /// is_free: [group + 1], for facets without a group first, then of each group: whether contact may happen there.
  /// Collective.
  FreeSurface(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::span<const char> is_free);

  const Mesh& mesh() const noexcept { return *mesh_; }
  /// Facets of the mesh that belong to this rank, increasing.
  std::span<const LocalId> facets() const noexcept { return facets_; }
  /// Owned nodes that lie on free facets, of this rank or another, increasing.
  std::span<const LocalId> nodes() const noexcept { return {nodes_.data(), owned_}; }

  std::int32_t body_of_node(LocalId node) const { return node_body_[static_cast<std::size_t>(node)]; }
  std::int32_t body_of_facet(LocalId facet) const {
    return mesh_->element_region[static_cast<std::size_t>(mesh_->facet_element[static_cast<std::size_t>(facet)])];
  }

  /// The shares of nodes()[i], in an order that all holders have alike.
  std::span<const Vector> shares(std::size_t i) const {
    return std::span(shares_).subspan(offsets_[i], offsets_[i + 1] - offsets_[i]);
  }
  Vector normal(std::size_t i) const;  ///< unit mean normal of nodes()[i], out of the body
  Real area(std::size_t i) const;      ///< m^2 (m in 2D)
  /// Area of nodes()[i] projected on a plane that faces it: n points toward the node's body.
  Real facing_area(std::size_t i, const Vector& n) const;
  /// Smoothed normal of a facet of this rank at its corner k, unit: mean over the facets at that node which are bent
  /// against this one by less than `feature_angle` (degrees).
  Vector corner_normal(LocalId facet, int k, Real feature_angle = 40) const;

  /// Mean edge length of a body's free facets [m]; 0 where it has none. Collective.
  Real mean_edge(const Communicator& comm, std::int32_t body) const;

 private:
  void collect_facets(std::span<const char> is_free, Geometry geometry);
  void gather_shares(const Communicator& comm, Geometry geometry);
  std::size_t find(LocalId node) const;

  const Mesh* mesh_;
  std::vector<LocalId> facets_;
  std::vector<std::int32_t> node_body_;  ///< [local node]
  std::vector<LocalId> nodes_;           ///< owned, then copies that are corners of facets_; increasing
  std::size_t owned_ = 0;                ///< of nodes_
  std::vector<std::size_t> offsets_ = {0};
  std::vector<Vector> shares_;
};

}  // namespace malleus::forge
