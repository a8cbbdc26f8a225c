#pragma once

#include <array>

#include "mesh/assemble.hpp"

namespace malleus::test {

struct BoxMeshOptions {
  int dim = 3;
  std::array<int, 3> cells = {4, 4, 4};  ///< along x, y, z
  std::array<Real, 3> low = {0, 0, 0};   ///< m
  std::array<Real, 3> high = {1, 1, 1};  ///< m
  Real jitter = 0;                       ///< share of a cell by which inner nodes move, < 0.25
};

/// A box cut into cells of 6 tetrahedra (Kuhn) or 2 triangles; region "box", groups x_low, x_high, y_low, ... The
/// cells are dealt to the ranks in slabs along the longest count of cells, so some ranks may be empty. Node numbers
/// before assembly: i + (nx+1) (j + (ny+1) k). Collective.
MeshPiece box_piece(const Communicator& comm, const BoxMeshOptions& options);
Mesh box_mesh(const Communicator& comm, const BoxMeshOptions& options);

}  // namespace malleus::test
