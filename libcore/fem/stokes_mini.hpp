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

/// Element of Arnold, Brezzi, Fortin (1984): v = sum v_a phi_a + v_b b, p = sum p_a phi_a, b the product of the phi_a
/// with value 1 at the centroid. With one viscosity eta and one force field an element, v_b is eliminated:
///
///     K_b v_b = s (f - grad p),   K_b = eta k ((tr G) I + G),  G = sum_a grad phi_a grad phi_a^T,
///     s = integral of b,          k = 81/20 V (D = 2), 4096/945 V (D = 3)
///
/// which leaves [A B^T; B -C] with A_ab = eta V (grad phi_a . grad phi_b I + grad phi_b grad phi_a^T),
/// B_ab = -V/(D+1) grad phi_b^T and C_ab = s^2 grad phi_a^T K_b^-1 grad phi_b. b and the phi_a are orthogonal in A.
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
  /// K_b, equal to viscosity but in tests of the tangent.
  ElementUnknowns<D> residual(const ElementUnknowns<D>& unknowns, Real viscosity, Real bubble_viscosity) const;
  /// What stands against it: integral of f.w, and of -q divergence, with the bubble's part; residual = load in balance.
  ElementUnknowns<D> load(const ElementLoad<D>& load, Real bubble_viscosity) const;

  /// Derivative of residual() with C frozen (else it were not symmetric): A of the viscosity, and
  /// slope 4 V (eps(v):eps(dv)) (eps(v):eps(w)); slope 0 gives Picard's matrix. Columns and rows of the pressure are
  /// multiplied by `scale`.
  void matrix(const Eigen::Matrix<Real, D, D + 1>& velocity, Real viscosity, Real slope, Real scale,
              ElementMatrix<D>& result) const;

 private:
  Eigen::Matrix<Real, D, D> strain_rate(const Eigen::Matrix<Real, D, D + 1>& velocity) const;

  Eigen::Matrix<Real, D, D + 1> gradients_;
  Eigen::Matrix<Real, D, D> bubble_inverse_;  ///< K_b^-1 for eta = 1
  Real volume_;
  Real bubble_;  ///< s
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
  void matrix(const Eigen::Matrix<Real, 2, 3>& velocity, Real viscosity, Real slope, Real scale,
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
