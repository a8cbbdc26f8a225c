#include "forge/facet_tree.hpp"

#include <numeric>
#include <tuple>

namespace malleus::forge {
namespace {

constexpr LocalId facets_of_a_leaf = 4;

}  // namespace

Vector FacetSet::area_normal(LocalId facet) const {
  const Vector edge = corner(facet, 1) - corner(facet, 0);
  if (dim == 2) return {edge[1], -edge[0], 0};
  return 0.5 * edge.cross(corner(facet, 2) - corner(facet, 0));
}

Bounds FacetSet::bounds(LocalId facet) const {
  Bounds box;
  for (int k = 0; k < dim; ++k) box.add(corner(facet, k));
  return box;
}

ClosestPoint FacetSet::closest(LocalId facet, const Vector& point) const {
  return dim == 2 ? closest_on_segment(point, corner(facet, 0), corner(facet, 1))
                  : closest_on_triangle(point, corner(facet, 0), corner(facet, 1), corner(facet, 2));
}

FacetTree::FacetTree(const FacetSet& set) : set_(&set) {
  order_.resize(set.facets.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::vector<Vector> centres;
  for (LocalId f = 0; f < set.size(); ++f) {
    const Bounds box = set.bounds(f);
    centres.push_back(0.5 * (box.low + box.high));
  }
  if (!order_.empty()) build(centres, 0, set.size());
}

void FacetTree::build(std::span<const Vector> centres, LocalId begin, LocalId end) {
  const std::size_t self = nodes_.size();
  Node node;
  node.begin = begin;
  node.end = end;
  Bounds spread;
  for (LocalId i = begin; i < end; ++i) {
    const LocalId facet = order_[static_cast<std::size_t>(i)];
    node.bounds.add(set_->bounds(facet));
    spread.add(centres[static_cast<std::size_t>(facet)]);
  }
  nodes_.push_back(node);
  if (end - begin <= facets_of_a_leaf) return;
  int axis = 0;
  (spread.high - spread.low).maxCoeff(&axis);
  const LocalId middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end, [&](LocalId a, LocalId b) {
    return std::tuple(centres[static_cast<std::size_t>(a)][axis], a) <
           std::tuple(centres[static_cast<std::size_t>(b)][axis], b);
  });
  build(centres, begin, middle);
  nodes_[self].right = static_cast<LocalId>(nodes_.size());
  build(centres, middle, end);
}

ClosestFacet FacetTree::closest(const Vector& point, Real reach, const std::function<bool(LocalId)>& admits) const {
  ClosestFacet best;
  Real limit = reach * reach;
  std::vector<LocalId> stack;
  if (!nodes_.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const LocalId index = stack.back();
    stack.pop_back();
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.bounds.squared_distance(point) > limit) continue;
    if (node.right >= 0) {
      const LocalId left = index + 1;
      const bool left_first = nodes_[static_cast<std::size_t>(left)].bounds.squared_distance(point) <=
                              nodes_[static_cast<std::size_t>(node.right)].bounds.squared_distance(point);
      stack.push_back(left_first ? node.right : left);
      stack.push_back(left_first ? left : node.right);
      continue;
    }
    for (LocalId i = node.begin; i < node.end; ++i) {
      const LocalId facet = order_[static_cast<std::size_t>(i)];
      if (admits && !admits(facet)) continue;
      const ClosestPoint candidate = set_->closest(facet, point);
      if (candidate.squared_distance > limit) continue;
      if (candidate.squared_distance == limit && best.facet >= 0 && facet > best.facet) continue;
      best = {facet, candidate};
      limit = candidate.squared_distance;
    }
  }
  return best;
}

std::vector<LocalId> FacetTree::within(const Vector& point, Real reach) const {
  std::vector<LocalId> found;
  std::vector<LocalId> stack;
  if (!nodes_.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const LocalId index = stack.back();
    stack.pop_back();
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.bounds.squared_distance(point) > reach * reach) continue;
    if (node.right >= 0) {
      stack.push_back(index + 1);
      stack.push_back(node.right);
      continue;
    }
    for (LocalId i = node.begin; i < node.end; ++i) {
      const LocalId facet = order_[static_cast<std::size_t>(i)];
      if (set_->closest(facet, point).squared_distance <= reach * reach) found.push_back(facet);
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace malleus::forge
