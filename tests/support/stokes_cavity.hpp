#pragma once

#include <array>
#include <memory>
#include <vector>

#include "fem/stokes_operator.hpp"
#include "support/box_mesh.hpp"

namespace malleus::test {

/// What a linear solver starts from at a state: the residual with the other sign. Collective.
LinearVector right_side_of(StokesOperator& equations, const StokesState& state);

struct Sphere {
  std::array<Real, 3> center{};
  Real radius = 0;
};

struct CavityOptions {
  BoxMeshOptions box;
  Real inside = 1;              ///< viscosity in the spheres, Pa.s; 1 outside
  Real viscosity_scale = 1;     ///< of both
  std::vector<Sphere> spheres;  ///< discs in 2D
  bool is_floating = false;     ///< nothing is fixed anywhere
  bool is_open = false;  ///< sides without traction, bottom fixed, top moving down at 1: an upsetting that sticks
  Real aspect = 1;       ///< the last coordinate is divided by this
  /// Dimensionless penalty r h / eta of contacts on the nodes of a patch of the side x = 1; with is_open.
  Real penalty = 0;
  bool matrix_free = false;
};

/// `count` spheres of radius 0.05 to 0.13 in the unit box, always the same; apart from each other where `disjoint`, and
/// then smaller if there are more than 8.
std::vector<Sphere> spread_spheres(int count, bool disjoint);

/// A box of the unit size whose lid moves, 16 x (1-x) y (1-y) along x, with spheres of another viscosity. The
/// stiffer material has a weight, 10 N/m^3 for a viscosity of 1.
class StokesCavity {
 public:
  StokesCavity(const Communicator& comm, const CavityOptions& options);
  StokesCavity(const StokesCavity&) = delete;
  StokesCavity& operator=(const StokesCavity&) = delete;

  const Mesh& mesh() const { return mesh_; }
  StokesOperator& equations() { return *equations_; }
  const LinearSystem& system() const { return *system_; }
  const LinearVector& right_side() const { return right_side_; }

 private:
  void add_penalties(Real penalty, Real viscosity);

  Mesh mesh_;
  std::unique_ptr<ResidualTerm> contacts_;
  std::unique_ptr<GivenViscosity> model_;
  std::unique_ptr<StokesOperator> equations_;
  const LinearSystem* system_ = nullptr;
  LinearVector right_side_;
};

}  // namespace malleus::test
