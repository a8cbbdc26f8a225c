#pragma once

/// What inertia adds to the P1+/P1 element. Sequential: knows no mesh, no ranks, no matrix.

#include "fem/facet.hpp"
#include "fem/stokes_mini.hpp"

namespace malleus {

/// Of an element: rho (dv/dt + v . grad v) with dv/dt = rate v - history.
template <int D>
struct ElementInertia {
  Real density = 0;                                                               ///< kg/m^3
  Real rate = 0;                                                                  ///< 1/s; 0: a steady flow
  Eigen::Matrix<Real, D, D + 1> history = Eigen::Matrix<Real, D, D + 1>::Zero();  ///< a column a vertex, m/s^2
};

/// Adds to a Stokes element whose subscales are v' = T (f - grad p) the terms of the Navier-Stokes equations, with the
/// residual-based subscales (Hughes, Franca, Balestra 1986; Tezduyar 1992)
///
///     r = rho (dv/dt + v . grad v) + grad p - f,   v' = -T_i r,   T_i^-1 = T^-1 + rho (rate + 2 |v|/h_v) I,
///
/// in the momentum integral rho (dv/dt + v . grad v).w + (rho v . grad w).T_i r, and in the rows of the pressures
/// -integral grad q . T_i r in place of -integral grad q . T (grad p - f). r is taken at its mean, h_v is the longest
/// segment along the mean velocity. In axisymmetric scenes all integrals are over the ring, and the part of T that the
/// bubble makes, which the Stokes element has eliminated, stays as it is.
template <int D>
class InertiaElement {
 public:
  /// points: of positive orientation. velocity: which carries, a column a vertex.
  InertiaElement(const SimplexPoints<D>& points, Geometry geometry, const ElementInertia<D>& inertia,
                 const Eigen::Matrix<Real, D, D + 1>& velocity, Real viscosity);

  /// What to add to MiniElement::residual() less load(); the velocity is that of the constructor.
  ElementUnknowns<D> residual(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load) const;
  /// Adds the derivative of residual() with T_i frozen; newton: with that of the carrying velocity. Columns and rows of
  /// the pressure are multiplied by `scale`. Not symmetric.
  void add_matrix(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load, bool newton, Real scale,
                  ElementMatrix<D>& result) const;
  /// Mean v', m/s.
  Point<D> subscale_velocity(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load) const;

 private:
  using Square = Eigen::Matrix<Real, D, D>;
  Point<D> imbalance(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load) const;
  void set_masses(const SimplexPoints<D>& points, Geometry geometry);

  ElementInertia<D> inertia_;
  Eigen::Matrix<Real, D, D + 1> velocity_;
  Eigen::Matrix<Real, D, D + 1> gradients_;
  Eigen::Matrix<Real, D + 1, D + 1> mass_;  ///< integral of phi_a phi_b, m^3
  Eigen::Matrix<Real, D + 1, 1> shares_;    ///< integral of phi_a, over the volume
  Eigen::Matrix<Real, D + 1, 1> carried_;   ///< mean v . grad phi_a, 1/s
  Square stokes_;                           ///< T
  Square subscale_;                         ///< T_i
  Real volume_;
};

extern template class InertiaElement<2>;
extern template class InertiaElement<3>;

}  // namespace malleus
