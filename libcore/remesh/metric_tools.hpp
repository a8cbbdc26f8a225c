#pragma once

/// Making metrics fit for use: bounds, gradation, intersection, a wanted number of nodes.

#include <span>

#include "remesh/metric.hpp"

namespace malleus {

/// Sizes (for tensors, in every direction) brought into [smallest, largest] [m].
void bound_sizes(Metric& metric, Real smallest, Real largest);

/// Limits how fast sizes change: along an edge of metric length l, the size at one end is at most that at the other
/// times beta^l for sizes h <= h_other + ln(beta) |e|; tensors likewise by intersection with the other end's tensor
/// grown by (1 + ln(beta) l)^2 (Alauzet 2010, eq. of the metric-space gradation). beta > 1; a list of changed nodes,
/// smallest sizes first, is worked until nothing changes. Uniform metrics are left alone.
void limit_gradation(const RemeshMesh& mesh, Metric& metric, Real beta);

/// The metric that asks for the smaller size in every direction, by simultaneous reduction of both tensors; sizes per
/// node give the smaller one. Both must fit the mesh.
Metric intersect(const RemeshMesh& mesh, const Metric& a, const Metric& b);

/// Number of elements that a remesh with this metric should make: the sum over elements of V sqrt(det M) over the
/// volume of the regular unit simplex.
Real predicted_elements(const RemeshMesh& mesh, const Metric& metric);
/// The same for each element: how many should take its place. [element]
std::vector<Real> predicted_elements_of_each(const RemeshMesh& mesh, const Metric& metric);

/// Predicted elements over nodes, as measured on our own meshes (whose elements are a fifth smaller than regular ones).
constexpr Real predicted_per_node(int dimension) {
  return dimension == 2 ? 1.9 : 4.6;
}

/// Multiplies all sizes, in every direction, by a factor > 0.
void scale_sizes(Metric& metric, Real factor);

/// Scales all sizes by one factor such that a remesh should make about this many nodes.
void scale_to_nodes(const RemeshMesh& mesh, Metric& metric, Real nodes);

/// The metric of one node becomes the intersection with another's. Both of the same kind, not uniform.
void intersect_at(Metric& metric, LocalId node, std::span<const Real> other);

/// The mesh's own sizes: at a node, the mean length of its edges [m].
Metric current_sizes(const RemeshMesh& mesh);

}  // namespace malleus
