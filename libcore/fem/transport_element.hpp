#pragma once

/// Element matrices of d(alpha)/dt + v . grad(alpha) = 0 on linear simplices, stabilized along the streamlines.

#include "mesh/simplex.hpp"

namespace malleus {

enum class Stabilization {
  transient,              ///< tau = 1 / sqrt((2/dt)^2 + (2|v|/h_v)^2)
  residual_free_bubbles,  ///< tau = h_v / (3|v|) (Brezzi et al. 1994)
};

/// Sum over the vertices of max(v . grad N_i, 0) = |v| / h_v [1/s], h_v the longest segment along v in the element.
template <int D>
Real streamline_rate(const P1Gradients<D>& p1, const Point<D>& velocity);

/// tau [s] for a step dt [s] and |v| / h_v [1/s].
Real stabilization_time(Stabilization kind, Real rate, Real dt);

/// With the test function N_i + tau v . grad N_i (v the element's mean in the stabilization, linear in the convection):
///   mass_ij       = int (N_i + tau v . grad N_i) N_j
///   convection_ij = int (N_i + tau v . grad N_i) v . grad N_j
template <int D>
struct TransportElement {
  Eigen::Matrix<Real, D + 1, D + 1> mass;
  Eigen::Matrix<Real, D + 1, D + 1> convection;
};

/// velocities: a column a vertex [m/s].
template <int D>
TransportElement<D> transport_element(const P1Gradients<D>& p1, const Eigen::Matrix<Real, D, D + 1>& velocities,
                                      Stabilization kind, Real dt);

}  // namespace malleus
