#pragma once

/// The heat equation on the mesh: temperatures at the nodes, one implicit step at a time.

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "fem/facet.hpp"
#include "fem/node_space.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// Heat that crosses from a node to a point between other nodes (the facet that it touches): conductance
/// (T_node - sum of weight times T_partner) [W]. Partners may be of any rank; -1: none.
struct HeatBridge {
  GlobalId node = -1;
  Real conductance = 0;  ///< W/K
  std::array<GlobalId, 3> partners = {-1, -1, -1};
  std::array<Real, 3> weights = {0, 0, 0};
  Real source = 0;  ///< W, given to the partners by their weights
};

/// What a step conducts and what it is given. Values at nodes are [local node], and those of copies add to their
/// owner's: a rank gives what its own facets and points give. In plane scenes all per metre of depth.
struct HeatScene {
  std::vector<Real> capacity;        ///< [element] J/(m^3 K), > 0; 0: no heat is modelled there
  std::vector<Real> conductivity;    ///< [element] W/(m K), >= 0
  std::vector<Real> element_source;  ///< [element] W/m^3; empty: none
  std::vector<Real> node_source;     ///< W; empty: none
  std::vector<Real> conductance;     ///< W/K to surroundings; empty: none
  std::vector<Real> surroundings;    ///< W, conductance times the temperature of the surroundings; as long
  std::vector<Real> emission;        ///< W/K^4, sigma times emissivity times area; empty: none
  Real radiates_to = 0;              ///< K
  std::vector<LocalId> fixed;        ///< nodes of imposed temperature, alike on all holders
  std::vector<Real> fixed_values;    ///< K
  std::vector<HeatBridge> bridges;   ///< each once, on any rank that holds its node
};

/// What a step did. stored = supplied - lost + imposed, to the solver's tolerance. The same on all ranks.
struct HeatReport {
  int iterations = 0;
  bool converged = true;
  Real stored = 0;    ///< J, in the material
  Real supplied = 0;  ///< J, by sources
  Real lost = 0;      ///< J, to surroundings and by radiation
  Real imposed = 0;   ///< J, in through nodes of imposed temperature
};

/// rho c dT/dt - div(k grad T) = q,  -k dT/dn = h (T - T_out) + sigma epsilon (T^4 - T_rad^4) on boundaries, by
/// backward Euler with linear elements and the mass matrix lumped: with non-obtuse elements no temperature leaves the
/// range of those around it, however short the step is against the time that heat takes through an element (a
/// consistent mass matrix overshoots there by a third, Rank, Katz, Werner 1983). Radiation is solved by Newton's
/// method, the linear systems by conjugate gradients with Jacobi's preconditioner, or with PETSc's GAMG where diffusion
/// prevails (options: heat_...).
class HeatEquation {
 public:
  /// The mesh must outlive this; its coordinates may change between steps.
  HeatEquation(const Communicator& comm, const Mesh& mesh, Geometry geometry, Real tolerance = 1e-9);
  ~HeatEquation();

  /// temperature: [local node] K, valid on copies before and after. dt > 0 [s]. Collective.
  HeatReport advance(const HeatScene& scene, Real dt, std::span<Real> temperature);

 private:
  class System;

  std::vector<Real> residual(const HeatScene& scene, const NodeSpace& space, std::span<const Real> before,
                             std::span<const Real> temperature, Real dt) const;
  void add_conduction(const HeatScene& scene, std::span<const Real> temperature, std::span<Real> sums) const;
  void assemble(const HeatScene& scene, Real dt, std::span<const Real> temperature);
  void mark_fixed(const HeatScene& scene);
  HeatReport account(const HeatScene& scene, Real dt, std::span<const Real> before, std::span<const Real> after,
                     std::span<const Real> residual) const;

  const Communicator& comm_;
  const Mesh& mesh_;
  Geometry geometry_;
  Real tolerance_;
  std::vector<Real> masses_;    ///< [local node] J/K, complete
  std::vector<char> is_fixed_;  ///< [local node] imposed, or not modelled
  std::unique_ptr<System> system_;
};

}  // namespace malleus
