#pragma once

/// What loops over the elements of a Stokes scene share. Internal to the operator.

#include <type_traits>
#include <vector>

#include "fem/facet.hpp"
#include "fem/stokes_mini.hpp"

namespace malleus {

/// Calls function(std::type_identity<Element>) with the element of a scene.
template <class Function>
void with_element(int dim, Geometry geometry, Function&& function) {
  if (dim == 3) return function(std::type_identity<MiniElement<3>>{});
  if (geometry == Geometry::axisymmetric) return function(std::type_identity<AxisymmetricMiniElement>{});
  return function(std::type_identity<MiniElement<2>>{});
}

/// The unknowns [local node][D+1] of an element.
template <int D>
ElementUnknowns<D> gather(const Mesh& mesh, LocalId element, std::span<const Real> unknowns) {
  ElementUnknowns<D> result;
  const auto nodes = mesh.nodes_of_element(element);
  for (int a = 0; a <= D; ++a) {
    const Real* values = unknowns.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * (D + 1);
    result.velocity.col(a) = Eigen::Map<const Point<D>>(values);
    result.pressure[a] = values[D];
  }
  return result;
}

/// Adds an element's values times a sign to sums [local node][D+1].
template <int D>
void scatter(const Mesh& mesh, LocalId element, const ElementUnknowns<D>& values, Real sign, std::vector<Real>& sums) {
  const auto nodes = mesh.nodes_of_element(element);
  for (int a = 0; a <= D; ++a) {
    Real* place = sums.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * (D + 1);
    for (int d = 0; d < D; ++d) place[d] += sign * values.velocity(d, a);
    place[D] += sign * values.pressure[a];
  }
}

}  // namespace malleus
