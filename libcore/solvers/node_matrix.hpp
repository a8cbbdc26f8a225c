#pragma once

/// A matrix between the P1 unknowns of the nodes, one a node, and the solver for it. For transport and other scalar
/// equations dominated by their mass matrix, which a few Jacobi-preconditioned iterations solve.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"
#include "mesh/node_graph.hpp"

namespace malleus {

/// Places of the element matrices' entries in the rows of the node graph.
struct ElementSlots {
  std::vector<std::int32_t> slots;  ///< [element][dim+1][dim+1], row then column: index in NodeGraph::neighbours
};

/// Local. The graph must have fewer than 2^31 entries on this rank.
ElementSlots build_element_slots(const Mesh& mesh, const NodeGraph& graph);

/// Each rank holds the sum over its own elements; a product sums the ranks' results at shared nodes. So nothing but
/// nodal values crosses the partition.
struct NodeMatrix {
  std::vector<Real> entries;  ///< one for each of NodeGraph::neighbours
};

/// y = A x on `rows` (increasing local nodes, on every holder of a node or on none); x valid on copies. y is valid on
/// owned rows only. Collective among neighbours.
void multiply(const Mesh& mesh, const NodeGraph& graph, const NodeMatrix& matrix, std::span<const LocalId> rows,
              std::span<const Real> x, std::span<Real> y);

struct NodeSolution {
  int iterations = 0;
  bool converged = true;
  Real residual = 0;  ///< ||b - A x|| / ||b||, by the recursion
};

struct NodeSystem {
  const Mesh& mesh;
  const NodeGraph& graph;
  const NodeMatrix& matrix;
  std::span<const LocalId> rows;  ///< where x is unknown, see multiply(); elsewhere x keeps what it holds
};

/// Solves A x = b on the rows of the system by BiCGStab (van der Vorst 1992) with Jacobi's preconditioner, from the x
/// given, to ||b - A x|| <= tolerance * ||b - A x0||. b is read on owned rows; x is valid on copies before and after.
/// Collective.
NodeSolution solve_bicgstab(const Communicator& comm, const NodeSystem& system, std::span<const Real> b,
                            std::span<Real> x, Real tolerance, int max_iterations = 500);

}  // namespace malleus
