#include "field/fielded_piece.hpp"

#include <algorithm>

#include "base/error.hpp"

namespace malleus {
namespace {

template <class T>
void append_all(std::vector<T>& target, const std::vector<T>& more) {
  target.insert(target.end(), more.begin(), more.end());
}

/// Distinct node numbers, increasing, and the place of each node of each piece among them.
std::vector<GlobalId> merge_numbers(const std::vector<FieldedPiece>& pieces,
                                    std::vector<std::vector<LocalId>>& places) {
  struct Origin {
    GlobalId number;
    std::size_t piece;
    std::size_t index;
  };
  std::vector<Origin> origins;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const auto& numbers = pieces[p].piece.node_numbers;
    places[p].resize(numbers.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) origins.push_back({numbers[i], p, i});
  }
  std::sort(origins.begin(), origins.end(), [](const Origin& a, const Origin& b) {
    return std::tie(a.number, a.piece, a.index) < std::tie(b.number, b.piece, b.index);
  });
  std::vector<GlobalId> merged;
  for (const Origin& origin : origins) {
    if (merged.empty() || merged.back() != origin.number) merged.push_back(origin.number);
    places[origin.piece][origin.index] = static_cast<LocalId>(merged.size()) - 1;
  }
  return merged;
}

/// Rows [n][width] of a piece to their places; a width of 0 does nothing.
void place_rows(const std::vector<Real>& rows, const std::vector<LocalId>& places, std::size_t width,
                std::vector<Real>& target) {
  if (width == 0) return;
  for (std::size_t i = 0; i < places.size(); ++i) {
    std::copy_n(rows.data() + i * width, width, target.data() + static_cast<std::size_t>(places[i]) * width);
  }
}

}  // namespace

FieldColumns::FieldColumns(FieldStore& store, Support support) {
  for (Field* field : store.all()) {
    if (field->spec().support != support) continue;
    fields_.push_back(field);
    width_ += static_cast<std::size_t>(field->components());
  }
}

void FieldColumns::append(LocalId entity, std::vector<Real>& row) const {
  for (const Field* field : fields_) row.insert(row.end(), field->at(entity), field->at(entity) + field->components());
}

void FieldColumns::scatter(std::span<const Real> rows, std::span<const LocalId> to, std::size_t entities) const {
  std::size_t column = 0;
  for (Field* field : fields_) {
    const auto components = static_cast<std::size_t>(field->components());
    std::vector<Real> values(entities * components);
    for (std::size_t i = 0; i < to.size(); ++i) {
      std::copy_n(rows.data() + i * width_ + column, components,
                  values.data() + static_cast<std::size_t>(to[i]) * components);
    }
    field->assign(std::move(values));
    column += components;
  }
}

FieldedPiece merge_pieces(const std::vector<FieldedPiece>& pieces) {
  check(!pieces.empty(), "there is a piece to merge");
  const auto dim = static_cast<std::size_t>(pieces.front().piece.dim);
  FieldedPiece merged;
  merged.piece.dim = pieces.front().piece.dim;
  merged.piece.region_names = pieces.front().piece.region_names;
  merged.piece.group_names = pieces.front().piece.group_names;
  std::vector<std::vector<LocalId>> places(pieces.size());
  merged.piece.node_numbers = merge_numbers(pieces, places);
  std::size_t width = 0;
  for (const FieldedPiece& part : pieces) {
    if (part.piece.nodes() > 0) width = part.node_values.size() / part.piece.node_numbers.size();
  }
  merged.piece.coordinates.resize(merged.piece.node_numbers.size() * dim);
  merged.node_values.resize(merged.piece.node_numbers.size() * width);
  for (std::size_t p = pieces.size(); p-- > 0;) {  // the first piece has the last word
    place_rows(pieces[p].piece.coordinates, places[p], dim, merged.piece.coordinates);
    place_rows(pieces[p].node_values, places[p], width, merged.node_values);
  }
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const MeshPiece& piece = pieces[p].piece;
    const auto in_merged = [&](LocalId node) { return places[p][static_cast<std::size_t>(node)]; };
    std::transform(piece.element_nodes.begin(), piece.element_nodes.end(),
                   std::back_inserter(merged.piece.element_nodes), in_merged);
    std::transform(piece.facet_nodes.begin(), piece.facet_nodes.end(), std::back_inserter(merged.piece.facet_nodes),
                   in_merged);
    append_all(merged.piece.element_region, piece.element_region);
    append_all(merged.piece.element_ids, piece.element_ids);
    append_all(merged.piece.facet_group, piece.facet_group);
    append_all(merged.element_values, pieces[p].element_values);
  }
  return merged;
}

Mesh assemble_with_fields(const Communicator& comm, const FieldedPiece& fielded, FieldStore& fields) {
  AssembledMesh assembled = assemble_mesh(comm, fielded.piece);
  FieldColumns(fields, Support::node)
      .scatter(fielded.node_values, assembled.node_of_piece, FieldStore::entities(assembled.mesh, Support::node));
  FieldColumns(fields, Support::element)
      .scatter(fielded.element_values, assembled.element_of_piece,
               FieldStore::entities(assembled.mesh, Support::element));
  return std::move(assembled.mesh);
}

}  // namespace malleus
