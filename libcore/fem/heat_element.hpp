#pragma once

/// Element integrals of the heat equation on linear simplices.

#include "fem/facet.hpp"

namespace malleus {

/// Of P1 functions phi over one element, weighted with 2 pi x in axisymmetric scenes:
///   stiffness_ij = int grad phi_i . grad phi_j   [m; 1 in plane scenes]
///   masses_i     = int phi_i                     [m^3; m^2 in plane scenes], the rows of the mass matrix summed
template <int D>
struct HeatElement {
  Eigen::Matrix<Real, D + 1, D + 1> stiffness;
  Eigen::Matrix<Real, D + 1, 1> masses;
};

template <int D>
HeatElement<D> heat_element(const SimplexPoints<D>& points, Geometry geometry) {
  const P1Gradients<D> p1 = p1_gradients<D>(points);
  HeatElement<D> element;
  element.stiffness = p1.volume * p1.gradients.transpose() * p1.gradients;
  element.masses.setConstant(p1.volume / (D + 1));
  if (geometry == Geometry::axisymmetric) {
    const auto radii = points.row(0).transpose();
    element.stiffness *= 2 * std::numbers::pi * radii.mean();
    // int phi_i r over a triangle is A/12 (r_0 + r_1 + r_2 + r_i).
    element.masses = 2 * std::numbers::pi * p1.volume / 12 * (radii.array() + radii.sum()).matrix();
  }
  return element;
}

}  // namespace malleus
