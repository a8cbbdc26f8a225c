#pragma once

/// A loose piece of mesh with the values of its fields: what messages and checkpoints carry.

#include <span>
#include <vector>

#include "field/field.hpp"
#include "mesh/assemble.hpp"

namespace malleus {

struct FieldedPiece {
  MeshPiece piece;
  std::vector<Real> node_values;     ///< [piece node][all components of the node fields, in the store's order]
  std::vector<Real> element_values;  ///< [piece element][all components of the element fields]
};

/// The fields of one support, side by side in the order of the store. Local.
class FieldColumns {
 public:
  FieldColumns(FieldStore& store, Support support);
  std::size_t width() const noexcept { return width_; }
  /// Appends the values of all fields at an entity to a row.
  void append(LocalId entity, std::vector<Real>& row) const;
  /// Gives the fields new sizes and values: row i of rows [n][width] goes to entity to[i] of `entities`.
  void scatter(std::span<const Real> rows, std::span<const LocalId> to, std::size_t entities) const;

 private:
  std::vector<Field*> fields_;
  std::size_t width_ = 0;
};

/// Pieces in one; nodes with the same number are merged and keep the values of the first piece that has them. Nodes
/// come out by increasing number. All pieces have the same names, dimension and fields; `pieces` is not empty. Local.
FieldedPiece merge_pieces(const std::vector<FieldedPiece>& pieces);

/// The mesh of the pieces, and the fields of the store on it. Collective.
Mesh assemble_with_fields(const Communicator& comm, const FieldedPiece& fielded, FieldStore& fields);

}  // namespace malleus
