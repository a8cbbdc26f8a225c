#pragma once

/// The workload: what is to be divided, as a weighted graph spread over the ranks.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"
#include "mesh/node_owners.hpp"
#include "partition/couplings.hpp"

namespace malleus {

/// What an increment costs, in units of work: an element, a node, and the exchange of one datum between two entities
/// (elements with a common face, nodes with a common edge) that lie in different parts. The paper's combined dual and
/// nodal graph (section 3.1.1).
struct WorkModel {
  Real element = 1;                   ///< assembling an element, >= 0
  Real node = node_work_in_elements;  ///< solving for a node, >= 0; the paper's times (its table 2) say 100
  Real communication = 1;             ///< per cut edge of either graph, at bandwidth 1, >= 0
  std::vector<Real> factor;  ///< [element] relative work of each, >= 0; empty = 1. Scaled so that the total stays.
  std::vector<NodeCoupling> couplings;  ///< beside the mesh, each on one rank
};

/// The work of this program's own solver: the defaults.
inline WorkModel solver_work() {
  return {};
}

/// The elements of all ranks as vertices, their common faces as edges. Vertices of this rank are [0, owned()), in the
/// order of the mesh; copies of their neighbours on other ranks follow. Coarser graphs, whose vertices are groups of
/// elements, have the same form.
struct WorkGraph {
  int dim = 3;
  Ownership ownership;
  std::vector<GlobalId> copy_numbers;  ///< increasing
  Halo halo;

  std::vector<std::int64_t> start;         ///< [owned + 1]
  std::vector<LocalId> neighbours;         ///< vertices, copies among them
  std::vector<std::int32_t> edge_weights;  ///< [edge] common faces
  std::vector<signed char> faces;          ///< [edge] of the element, -1 a coupling; only where vertices are elements
  std::vector<Real> weights;               ///< [owned] work in whole multiples of a unit, so that sums are exact
  std::vector<Real> centres;               ///< [owned][dim], m
  Real unit = 1;                           ///< work that a weight of 1 stands for

  LocalId owned() const noexcept { return static_cast<LocalId>(weights.size()); }
  LocalId vertices() const noexcept { return owned() + static_cast<LocalId>(copy_numbers.size()); }
  GlobalId number(LocalId vertex) const noexcept {
    return vertex < owned() ? ownership.begin() + vertex : copy_numbers[static_cast<std::size_t>(vertex - owned())];
  }
  std::size_t first(LocalId vertex) const { return static_cast<std::size_t>(start[static_cast<std::size_t>(vertex)]); }
  std::size_t last(LocalId vertex) const { return first(vertex + 1); }
};

/// The mean work of the elements with their share of the nodes' (a node's work divided by the elements around it, of
/// all ranks), times their factors: [element]. InputError where nothing weighs anything. Collective.
std::vector<Real> element_work(const Communicator& comm, const Mesh& mesh, const WorkModel& model);

/// Across each face the neighbour: [element][dim + 1] global element numbers (begin of this rank + local), -1 at the
/// boundary. elements: the layout. Collective.
std::vector<GlobalId> face_neighbours(const Communicator& comm, const Mesh& mesh, const Ownership& elements);

/// work: of each element, as element_work() gives it. Couplings become edges beside the faces. Collective.
WorkGraph build_work_graph(const Communicator& comm, const Mesh& mesh, std::span<const Real> work,
                           const std::vector<NodeCoupling>& couplings = {});

}  // namespace malleus
