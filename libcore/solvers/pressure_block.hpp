#pragma once

/// The Schur complement's approximation: S = M(1/eta)/2 + C, inverted by Chebyshev iteration.

#include "solvers/stokes_blocks.hpp"

namespace malleus {

/// Bounds of the Jacobi-scaled spectrum. For the consistent mass matrix of linear simplices it is [1/2, (d+2)/2]
/// exactly (Wathen 1987); a bound that is too low makes the iteration amplify, so the upper one is the larger of that
/// with a margin and an estimate by power iteration, which sees C on flat elements.
struct ChebyshevBounds {
  Real low = 0.35;
  Real high = 2.6;
};

class PressureBlock {
 public:
  /// Adds M to C; the graph stays with `blocks`, which must outlive this. Collective.
  PressureBlock(const LinearSystem& system, const StokesBlocks& blocks, int steps);

  /// correction ~ S^-1 residual. [owned node]; correction has room for the copies and gets their values too.
  /// Collective among neighbours.
  void apply(const float* residual, std::vector<float>& correction);

  ChebyshevBounds bounds() const { return bounds_; }
  std::size_t bytes() const;
  /// y = S x on the owned rows; x with its copies. Local.
  void multiply(const float* x, float* y) const;

 private:
  void estimate_bounds(const LinearSystem& system);

  const BlockLayout& layout_;
  const BlockGraph& graph_;
  int steps_;
  ChebyshevBounds bounds_;
  std::vector<float> values_;            ///< [entry]
  std::vector<float> inverse_diagonal_;  ///< [owned node]
  std::vector<float> product_, step_;    ///< [owned node]
};

}  // namespace malleus
