#pragma once

/// Moves a level set with a velocity: Crank-Nicolson in time, P1 stabilized along the streamlines in space.

#include <span>
#include <vector>

#include "fem/transport_element.hpp"
#include "mesh/mesh.hpp"
#include "mesh/node_graph.hpp"
#include "solvers/node_matrix.hpp"

namespace malleus {

struct TransportOptions {
  Stabilization stabilization = Stabilization::transient;
  Real front_cfl = 0.5;   ///< a substep moves the front at most this share of an element; sizes of 2 and more lose it
  Real tolerance = 1e-5;  ///< of the linear solve for the increment, relative
  Real narrow_band = 0;   ///< elements on either side of the front that are moved; 0 = all
};

/// Where the level set is imposed, on every holder of a node alike, and the value it has at the end of the step. In
/// between it goes there in a straight line.
struct ImposedLevelSet {
  std::vector<LocalId> nodes;
  std::vector<Real> values;  ///< m
};

struct TransportReport {
  int substeps = 0;
  int iterations = 0;
  Real front_cfl = 0;  ///< of the whole step, had it been one
  bool converged = true;
};

/// Solves d(alpha)/dt + v . grad(alpha) = 0 (paper eq. [11]) with the velocity frozen over the step. Of the paper's
/// stabilized form [14] the time derivative of the test function is left out and the residual is taken at mid-step:
/// backward Euler would diffuse the front (it loses 87 % of the disc in the vortex test at h = 1/64). A step is divided
/// so that the front moves at most `front_cfl` of an element in each part. With a narrow band, nodes farther than the
/// band hold its width: the level set is a distance near the front alone.
class LevelSetTransport {
 public:
  /// Mesh and graph must outlive this and not change. Local.
  LevelSetTransport(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph, TransportOptions options);

  /// Velocity [element][dim], m/s, that is added to the one at the nodes: what the flow's subscales carry. Empty: none.
  /// Must stay as it is until the next call. Local.
  void set_subscales(std::span<const Real> velocity) { subscales_ = velocity; }

  /// velocity: [node][dim] m/s; level_set: [node] m; both valid on copies, before and after. dt > 0 [s]. Collective.
  TransportReport advance(std::span<const Real> velocity, std::span<Real> level_set, Real dt,
                          const ImposedLevelSet& imposed);

  /// 1 / the time the front takes to cross an element [1/s]: the largest of the nodes of the elements that it touches.
  /// A node's rate is the mean of |v| / h_v over the elements around it, weighted by volume: a sliver counts by the
  /// little that it holds, where a largest value over elements would let it stop the run. Collective.
  Real front_rate(std::span<const Real> velocity, std::span<const Real> level_set);

 private:
  void compute_rates(std::span<const Real> velocity);
  Real largest_front_rate(std::span<const Real> level_set) const;
  Real largest_step(std::span<const Real> level_set) const;
  void choose_active(std::span<Real> level_set);
  void assemble(std::span<const Real> velocity, Real dt);
  void substep(std::span<Real> level_set, Real dt, Real share, const ImposedLevelSet& imposed, TransportReport& report);
  void clip(std::span<Real> level_set) const;
  std::vector<char> mark_nodes(std::span<const char> element_marks) const;

  const Communicator& comm_;
  const Mesh& mesh_;
  const NodeGraph& graph_;
  TransportOptions options_;
  template <int D>
  Eigen::Matrix<Real, D, D + 1> velocities_of(std::span<const Real> velocity, LocalId element) const;

  std::span<const Real> subscales_;
  ElementSlots slots_;
  NodeMatrix left_;  ///< mass + dt/2 convection
  NodeMatrix convection_;
  std::vector<Real> rates_;  ///< [node] mean |v| / h_v of the elements around it, 1/s
  std::vector<LocalId> active_rows_;
  std::vector<LocalId> active_elements_;
  Real band_width_ = 0;  ///< m
};

}  // namespace malleus
