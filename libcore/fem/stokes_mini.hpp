#pragma once

/// The P1+/P1 Stokes element with its bubble condensed. Sequential: knows no mesh, no ranks, no matrix.

#include <array>

#include "mesh/simplex.hpp"

namespace malleus {

/// Velocity [m/s] and pressure [Pa] at the vertices; or their residuals [N] and [m^3/s].
template <int D>
struct ElementUnknowns {
  Eigen::Matrix<Real, D, D + 1> velocity = Eigen::Matrix<Real, D, D + 1>::Zero();  ///< a column a vertex
  Eigen::Matrix<Real, D + 1, 1> pressure = Eigen::Matrix<Real, D + 1, 1>::Zero();
};

/// What acts on the inside of an element.
template <int D>
struct ElementLoad {
  Eigen::Matrix<Real, D, D + 1> force =
      Eigen::Matrix<Real, D, D + 1>::Zero();  ///< at the vertices, linear between; N/m^3
  Real divergence = 0;                        ///< div v demanded, 1/s
};

/// An element's matrix, a block (v_1..v_D, p) x (v_1..v_D, p) for each pair of vertices (row, column).
template <int D>
struct ElementMatrix {
  using Block = Eigen::Matrix<Real, D + 1, D + 1>;
  std::array<std::array<Block, D + 1>, D + 1> blocks;
};

/// Of an element in a tangent: eta [Pa.s], (d eta / d gamma) / gamma [Pa.s^3], scale of rows of the pressure.
struct TangentFactors {
  Real viscosity = 1;
  Real slope = 0;
  Real scale = 1;
};

/// Where an element's tangent is taken, for its products with steps.
template <int D>
struct SlopePoint {
  ElementUnknowns<D> state;
  Point<D> force;  ///< mean, N/m^3
  Real viscosity = 1;
  Real slope = 0;
  bool follows_subscales = false;  ///< with add_subscale_slope()
};

/// c of the subscales, see MiniElement. (D + 1)^2 / (12 D): 3/8 and 4/9; the bubble alone has 1/20 and 9/420.
template <int D>
inline constexpr Real subscale_share = (D + 1.0) * (D + 1.0) / (12.0 * D);

/// Velocity P1 with subscales, pressure P1: v = sum v_a phi_a + v', p = sum p_a phi_a. In the element of Arnold,
/// Brezzi, Fortin (1984) v' is a bubble, which vanishes on the element's faces; eliminated, with one viscosity eta an
/// element, it leaves [A B^T; B -C] with
///
///     A_ab = eta V (grad phi_a . grad phi_b I + grad phi_b grad phi_a^T),   B_ab = -V/(D+1) grad phi_b^T,
///     C_ab = grad phi_a^T T grad phi_b V,   v' = T (f - grad p) on the mean,
///     T = c/eta ((tr G) I + G)^-1,   G = sum_a grad phi_a grad phi_a^T.
///
/// The bubble's c is so small that it carries but a fifth (D = 2) or a twentieth (D = 3) of what flows between the
/// nodes. Here c is such that, in layers of regular simplices of height d, v' carries all of what linear functions lose
/// of the flow between parallel plates: T = d^2 / (12 eta). Any c > 0 is stable and of the same order (Hughes, Franca,
/// Balestra 1986); this one has a third of the bubble's error in channels, and in known solutions a quarter of that of
/// its pressure (docs/decisions.md).
template <int D>
class MiniElement {
 public:
  static constexpr int dim = D;
  /// points: of positive orientation, not flat.
  explicit MiniElement(const SimplexPoints<D>& points);

  Real volume() const noexcept { return volume_; }  ///< m^3 (m^2 in 2D)
  /// sqrt(2 eps:eps) of the P1 part, 1/s.
  Real shear_rate(const Eigen::Matrix<Real, D, D + 1>& velocity) const;

  /// integral of 2 eta eps(v):eps(w) - p div w, and of -q div v, tested with every phi_a. bubble_viscosity: that of
  /// T, equal to viscosity but in tests of the tangent.
  ElementUnknowns<D> residual(const ElementUnknowns<D>& unknowns, Real viscosity, Real bubble_viscosity) const;
  /// What stands against it: integral of f.w, and of -q divergence, with the subscales' part; residual = load in
  /// balance.
  ElementUnknowns<D> load(const ElementLoad<D>& load, Real bubble_viscosity) const;

  /// Mean v' [m/s] of an element, T (f - grad p); for an axisymmetric scene that of the same section.
  Point<D> subscale_velocity(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load, Real viscosity) const;

  /// Derivative of residual() with T frozen, which is symmetric: A of the viscosity, and
  /// slope 4 V (eps(v):eps(dv)) (eps(v):eps(w)); slope 0 gives Picard's matrix. Columns and rows of the pressure are
  /// multiplied by `scale`.
  void matrix(const Eigen::Matrix<Real, D, D + 1>& velocity, const TangentFactors& factors,
              ElementMatrix<D>& result) const;
  /// Adds what is missing to the derivative of residual() - load(): T follows the viscosity, so in the rows of the
  /// pressures -integral grad q . T (f - grad p) (d eta / eta), d eta = slope 2 eps(v):eps(dv).
  void add_subscale_slope(const ElementUnknowns<D>& unknowns, const ElementLoad<D>& load, const TangentFactors& factors,
                          ElementMatrix<D>& result) const;
  /// Adds what a slope adds to the product of the matrix with a step, scale 1; the rest of it is residual(step).
  void add_slope_product(const ElementUnknowns<D>& step, const SlopePoint<D>& at, ElementUnknowns<D>& product) const;

 private:
  Eigen::Matrix<Real, D, D> strain_rate(const Eigen::Matrix<Real, D, D + 1>& velocity) const;

  Eigen::Matrix<Real, D, D + 1> gradients_;
  Eigen::Matrix<Real, D, D> subscale_;  ///< T V for eta = 1
  Real volume_;
};

extern template class MiniElement<2>;
extern template class MiniElement<3>;

/// The same element revolved about the axis x = 0: x = r, y = z, all integrals over the whole ring (weight 2 pi r),
/// with the hoop rate v_r / r. b and the phi_a are not orthogonal here, and the bubble is eliminated from A and B as
/// well. The shear rate is the root of the ring's mean of 2 eps:eps for the condensed field. Vertices may lie on the
/// axis; their v_r must be zero.
class AxisymmetricMiniElement {
 public:
  static constexpr int dim = 2;
  explicit AxisymmetricMiniElement(const SimplexPoints<2>& points);

  Real volume() const noexcept { return volume_; }  ///< of the ring, m^3
  Real shear_rate(const Eigen::Matrix<Real, 2, 3>& velocity) const;
  ElementUnknowns<2> residual(const ElementUnknowns<2>& unknowns, Real viscosity, Real bubble_viscosity) const;
  ElementUnknowns<2> load(const ElementLoad<2>& load, Real bubble_viscosity) const;
  void matrix(const Eigen::Matrix<Real, 2, 3>& velocity, const TangentFactors& factors, ElementMatrix<2>& result) const;
  void add_subscale_slope(const ElementUnknowns<2>& unknowns, const ElementLoad<2>& load, const TangentFactors& factors,
                          ElementMatrix<2>& result) const;

 private:
  using Velocity = Eigen::Matrix<Real, 6, 1>;
  Eigen::Matrix<Real, 6, 6> stiffness_;    ///< A for eta = 1, bubble eliminated
  Eigen::Matrix<Real, 3, 6> divergence_;   ///< B, bubble eliminated
  Eigen::Matrix<Real, 3, 3> compliance_;   ///< C for eta = 1
  Eigen::Matrix<Real, 6, 6> force_load_;   ///< force at the vertices -> load on the velocities
  Eigen::Matrix<Real, 3, 6> bubble_load_;  ///< force at the vertices -> load on the pressures, for eta = 1
  Eigen::Matrix<Real, 3, 1> ring_;         ///< integral of each phi_a
  Real volume_;
};

}  // namespace malleus
