#pragma once

/// Closest facet of a surface through a tree of boxes. Everything here is local.

#include <functional>
#include <span>
#include <vector>

#include "forge/closest_point.hpp"

namespace malleus::forge {

/// A surface of triangles in 3D, of segments in 2D, oriented so that its normal points out of the solid (in 2D: the
/// segment's direction turned by -90 degrees).
struct FacetSet {
  int dim = 3;
  std::vector<Vector> points;
  std::vector<std::array<LocalId, 3>> facets;  ///< indices in points; the third is -1 in 2D

  LocalId size() const noexcept { return static_cast<LocalId>(facets.size()); }
  const Vector& corner(LocalId facet, int k) const {
    return points[static_cast<std::size_t>(facets[static_cast<std::size_t>(facet)][static_cast<std::size_t>(k)])];
  }
  Vector area_normal(LocalId facet) const;  ///< normal times area [m^2] (length [m] in 2D)
  Bounds bounds(LocalId facet) const;
  ClosestPoint closest(LocalId facet, const Vector& point) const;
};

struct ClosestFacet {
  LocalId facet = -1;  ///< -1: none within reach
  ClosestPoint at;
};

/// Holds the boxes, not the facets: the set given at construction must outlive it and keep its points.
class FacetTree {
 public:
  FacetTree() = default;
  explicit FacetTree(const FacetSet& set);

  /// Closest facet not farther than `reach` [m], of those that `admits` (where given) takes; among equally close ones
  /// that of the lowest number.
  ClosestFacet closest(const Vector& point, Real reach, const std::function<bool(LocalId)>& admits = {}) const;
  /// Facets not farther than `reach`, in increasing order of number.
  std::vector<LocalId> within(const Vector& point, Real reach) const;
  Bounds bounds() const { return nodes_.empty() ? Bounds{} : nodes_.front().bounds; }

 private:
  struct Node {
    Bounds bounds;
    LocalId begin = 0;  ///< leaf: facets order_[begin, end)
    LocalId end = 0;
    LocalId right = -1;  ///< inner: the left child follows, this is the right one; -1: leaf
  };
  void build(std::span<const Vector> centres, LocalId begin, LocalId end);

  const FacetSet* set_ = nullptr;
  std::vector<Node> nodes_;
  std::vector<LocalId> order_;
};

}  // namespace malleus::forge
