#pragma once

/// The loops over blocks in which a multigrid cycle spends its time. T is float or double. All local; vectors are
/// [block][size], owned blocks and then copies.

#include "solvers/multigrid/block_rows.hpp"

namespace malleus {

/// A square matrix ready for sweeps.
template <class T>
struct SweepMatrix {
  const BlockGraph* graph = nullptr;
  const BlockValues<T>* values = nullptr;
  const T* inverses = nullptr;  ///< [row][block], column by column; padded
};

/// One forward Gauss-Seidel sweep from x = 0, on the owned part: (L + D) x = b. Copies of x are neither read nor
/// written.
template <class T>
void sweep_forward_from_zero(const SweepMatrix<T>& matrix, const T* b, T* x);

/// r = b - A x after sweep_forward_from_zero(b, x): -U x, U with the couplings to copies, so b need not be read.
template <class T>
void residual_after_forward(const SweepMatrix<T>& matrix, const T* x, T* residual);

/// b -= A x on the owned rows; x with its copies.
template <class T>
void subtract_product(const SweepMatrix<T>& matrix, const T* x, T* b);

/// One backward Gauss-Seidel sweep on the owned part; copies of x stay as they are.
template <class T>
void sweep_backward(const SweepMatrix<T>& matrix, const T* b, T* x);

/// One forward sweep from any x.
template <class T>
void sweep_forward(const SweepMatrix<T>& matrix, const T* b, T* x);

/// fine += P coarse, for the owned fine rows.
template <class T>
void add_prolonged(const BlockGraph& graph, const BlockValues<T>& p, const T* coarse, T* fine);

/// coarse = P^T fine: sums of this rank's rows, for its owned and copied coarse blocks. coarse_blocks: their number.
template <class T>
void restrict_rows(const BlockGraph& graph, const BlockValues<T>& p, const T* fine, LocalId coarse_blocks, T* coarse);

}  // namespace malleus
