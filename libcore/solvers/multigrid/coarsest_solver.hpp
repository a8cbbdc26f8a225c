#pragma once

/// The end of the hierarchy: direct on one rank, or sweeps where the level is large or spread.

#include <Eigen/Dense>

#include "solvers/multigrid/block_kernels.hpp"
#include "solvers/multigrid/coarse_space.hpp"

namespace malleus {

template <class T>
class CoarsestSolver {
 public:
  /// Direct where one rank holds the whole level and it has at most 3,000 unknowns; else 16 symmetric sweeps.
  /// level: with its diagonals inverted. Collective.
  CoarsestSolver(const Communicator& comm, MultigridLevel level);

  std::vector<T>& right_side() { return b_; }            ///< [owned node][block]
  const std::vector<T>& solution() const { return x_; }  ///< [node][block]
  void solve();                                          ///< collective among neighbours
  bool is_direct() const { return is_direct_; }

 private:
  void sweep();

  BlockLayout layout_;
  bool is_direct_ = false;
  Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> inverse_;
  BlockGraph graph_;
  BlockValues<T> values_;
  std::vector<T> inverses_;
  std::vector<T> b_, x_;
};

}  // namespace malleus
