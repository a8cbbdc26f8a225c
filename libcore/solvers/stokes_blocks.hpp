#pragma once

/// The blocks of a monolithic Stokes matrix, as the preconditioner uses them.

#include "fem/linear_system.hpp"
#include "solvers/multigrid/block_rows.hpp"
#include "solvers/preconditioner_settings.hpp"

namespace malleus {

/// All blocks share one graph: a row per owned node. The entries are those of the system times `scaling`.
struct StokesBlocks {
  BlockLayout layout;
  BlockGraph graph;
  BlockValues<Real> velocity;   ///< A: dim x dim
  BlockValues<float> gradient;  ///< B^T: dim x 1
  std::vector<float> pressure;  ///< C: [entry]
  Real scaling = 1;             ///< a power of two that brings the largest diagonal entry near 1
};

/// Reads the matrix of the system (BAIJ, sequential or distributed). Entries that are made for this alone are rounded
/// to single precision where that of the cycle is. Collective.
StokesBlocks extract_blocks(const LinearSystem& system, CyclePrecision precision = CyclePrecision::double_precision);

}  // namespace malleus
