#pragma once

#include <memory>

#include "fem/stokes_operator.hpp"
#include "support/box_mesh.hpp"

namespace malleus::test {

/// A Norton-Hoff block, K = 2, between sticking platens that close at speed 1 along y; its sides are free.
struct StickingBlock {
  /// cut_off: shear rate below which the viscosity stays, 1/s. Collective.
  StickingBlock(const Communicator& comm, const BoxMeshOptions& box, Real sensitivity, Real cut_off);
  StickingBlock(const StickingBlock&) = delete;
  StickingBlock& operator=(const StickingBlock&) = delete;

  Mesh mesh;
  std::unique_ptr<RegionViscosity> model;
  StokesOperator op;
};

}  // namespace malleus::test
