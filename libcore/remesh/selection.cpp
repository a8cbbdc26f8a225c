#include "remesh/selection.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "base/index.hpp"
#include "field/fielded_piece.hpp"
#include "mesh/faces.hpp"
#include "parallel/agreement.hpp"
#include "remesh/interpolate.hpp"

namespace malleus {
namespace {

/// What is cut out of a mesh, and what of the mesh is left around it.
class Cut {
 public:
  Cut(const Mesh& mesh, std::span<const std::uint8_t> selected)
      : mesh_(mesh), selected_(selected), kept_(shared_nodes(mesh)), place_(kept_.size(), -1) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (selected_[index(e)] != 0) continue;
      for (const LocalId node : mesh.nodes_of_element(e)) kept_[index(node)] = 1;
    }
    take_elements();
    take_facets();
  }

  const RemeshMesh& arrays() const { return arrays_; }
  /// Nodes of the mesh that were cut out, in the order of arrays().
  const std::vector<LocalId>& nodes() const { return nodes_; }
  /// Facets with a group that the remesher does not see: they stay as they are.
  const std::vector<LocalId>& facets_left() const { return facets_left_; }
  bool is_kept(LocalId node) const { return kept_[index(node)] != 0; }
  bool is_selected(LocalId element) const { return selected_[index(element)] != 0; }

 private:
  void take_elements() {
    arrays_.dimension = mesh_.dim;
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      if (!is_selected(e)) continue;
      for (const LocalId node : mesh_.nodes_of_element(e)) {
        if (place_[index(node)] < 0) {
          place_[index(node)] = static_cast<LocalId>(nodes_.size());
          nodes_.push_back(node);
        }
        arrays_.element_nodes.push_back(place_[index(node)]);
      }
      arrays_.element_region.push_back(mesh_.element_region[index(e)]);
    }
    for (const LocalId node : nodes_) {
      arrays_.coordinates.insert(arrays_.coordinates.end(), mesh_.point(node), mesh_.point(node) + mesh_.dim);
      arrays_.frozen.push_back(kept_[index(node)]);
    }
  }

  void take_facets() {
    std::vector<LocalId> neighbours;
    if (mesh_.facets() > mesh_.exterior_facets)
      neighbours = element_neighbours(mesh_.dim, mesh_.nodes(), mesh_.element_nodes);
    for (LocalId f = 0; f < mesh_.facets(); ++f) {
      const LocalId element = mesh_.facet_element[index(f)];
      bool inside = is_selected(element);
      if (inside && f >= mesh_.exterior_facets) {
        const LocalId beyond = neighbours[index(element) * index(mesh_.dim + 1) + face_of(f)];
        inside = beyond >= 0 && is_selected(beyond);
      }
      if (inside) {
        for (const LocalId node : mesh_.nodes_of_facet(f)) arrays_.facet_nodes.push_back(place_[index(node)]);
        arrays_.facet_group.push_back(mesh_.facet_group[index(f)]);
      } else if (mesh_.facet_group[index(f)] >= 0) {
        facets_left_.push_back(f);
      }
    }
  }

  /// Local number of a facet in its element: that of the node it does not have.
  std::size_t face_of(LocalId facet) const {
    const auto of_facet = mesh_.nodes_of_facet(facet);
    const auto of_element = mesh_.nodes_of_element(mesh_.facet_element[index(facet)]);
    std::size_t face = 0;
    while (std::find(of_facet.begin(), of_facet.end(), of_element[face]) != of_facet.end()) ++face;
    return face;
  }

  const Mesh& mesh_;
  std::span<const std::uint8_t> selected_;
  std::vector<std::uint8_t> kept_;  ///< [node] it must stay: other ranks or elements not selected have it
  std::vector<LocalId> place_;      ///< [node] in arrays_
  RemeshMesh arrays_;
  std::vector<LocalId> nodes_;
  std::vector<LocalId> facets_left_;
};

/// Values of the fields of one support after a remesh of what was cut out.
class Transferred {
 public:
  Transferred(FieldStore& fields, const Mesh& mesh, const Cut& cut, const RemeshMesh& after, const Metric& carried)
      : fields_(fields), mesh_(mesh), cut_(cut), after_(after), carried_(carried) {}

  /// [new node][all components of the node fields]
  std::vector<Real> node_rows() const {
    const FieldColumns columns(fields_, Support::node);
    std::vector<Real> before;
    for (const LocalId node : cut_.nodes()) columns.append(node, before);
    if (columns.width() == 0 || after_.nodes() == 0) return {};
    std::vector<std::int32_t> region(index(after_.nodes()), 0);
    for (LocalId e = 0; e < after_.elements(); ++e) {
      for (const LocalId node : after_.nodes_of_element(e)) region[index(node)] = after_.element_region[index(e)];
    }
    const PointLocations at = PointLocator(cut_.arrays()).locate(after_.coordinates, region);
    std::vector<Real> rows = interpolate(cut_.arrays(), at, before, static_cast<int>(columns.width()));
    std::size_t column = 0;
    for (const Field* field : fields_.all()) {
      if (field->spec().support != Support::node) continue;
      correct_column(*field, rows, columns.width(), column);
      column += static_cast<std::size_t>(field->components());
    }
    return rows;
  }

  /// [new element][all components of the element fields]
  std::vector<Real> element_rows() const {
    const FieldColumns columns(fields_, Support::element);
    std::vector<Real> rows(index(after_.elements()) * columns.width(), 0);
    std::size_t column = 0;
    for (const Field* field : fields_.all()) {
      if (field->spec().support != Support::element) continue;
      const auto n = static_cast<std::size_t>(field->components());
      if (field->spec().transfer != Transfer::recompute && after_.elements() > 0) {
        const std::vector<Real> values =
            transfer_elements(cut_.arrays(), after_, selected_values(*field), field->components(),
                              field->spec().transfer == Transfer::conserve);
        for (std::size_t e = 0; e < index(after_.elements()); ++e)
          std::copy_n(values.data() + e * n, n, rows.data() + e * columns.width() + column);
      }
      column += n;
    }
    return rows;
  }

 private:
  void correct_column(const Field& field, std::vector<Real>& rows, std::size_t width, std::size_t column) const {
    const auto n = static_cast<std::size_t>(field.components());
    const bool is_metric = field.spec().name == metric_field_name;
    if (!is_metric && field.spec().transfer != Transfer::recompute) return;
    for (std::size_t node = 0; node < index(after_.nodes()); ++node) {
      for (std::size_t c = 0; c < n; ++c)
        rows[node * width + column + c] = is_metric ? carried_.values()[node * n + c] : 0;
    }
  }

  std::vector<Real> selected_values(const Field& field) const {
    std::vector<Real> values;
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      if (cut_.is_selected(e)) values.insert(values.end(), field.at(e), field.at(e) + field.components());
    }
    return values;
  }

  FieldStore& fields_;
  const Mesh& mesh_;
  const Cut& cut_;
  const RemeshMesh& after_;
  const Metric& carried_;
};

/// The old mesh without what was cut out, and what became of that.
class Joint {
 public:
  Joint(FieldStore& fields, const Mesh& mesh, const Cut& cut) : fields_(fields), mesh_(mesh), cut_(cut) {
    joined_.piece.dim = mesh.dim;
    joined_.piece.region_names = mesh.region_names;
    joined_.piece.group_names = mesh.group_names;
    place_.assign(index(mesh.nodes()), -1);
  }

  void add_rest() {
    const FieldColumns node_columns(fields_, Support::node);
    const FieldColumns element_columns(fields_, Support::element);
    for (LocalId node = 0; node < mesh_.nodes(); ++node) {
      if (!cut_.is_kept(node)) continue;
      place_[index(node)] = add_node(mesh_.global_node(node), mesh_.point(node));
      node_columns.append(node, joined_.node_values);
    }
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      if (cut_.is_selected(e)) continue;
      for (const LocalId node : mesh_.nodes_of_element(e)) joined_.piece.element_nodes.push_back(place_[index(node)]);
      joined_.piece.element_region.push_back(mesh_.element_region[index(e)]);
      element_columns.append(e, joined_.element_values);
    }
    for (const LocalId f : cut_.facets_left()) {
      for (const LocalId node : mesh_.nodes_of_facet(f)) joined_.piece.facet_nodes.push_back(place_[index(node)]);
      joined_.piece.facet_group.push_back(mesh_.facet_group[index(f)]);
    }
  }

  /// first_number: of the new nodes, which must not meet any other rank's.
  void add_new(const RemeshMesh& after, GlobalId first_number, const Transferred& values) {
    const std::vector<Real> rows = values.node_rows();
    const std::size_t width = FieldColumns(fields_, Support::node).width();
    std::vector<LocalId> place(index(after.nodes()), -1);
    for (LocalId node = 0; node < after.nodes(); ++node) {
      const LocalId origin = after.origin[index(node)];
      if (origin >= 0 && cut_.arrays().frozen[index(origin)] != 0) {
        place[index(node)] = place_[index(cut_.nodes()[index(origin)])];
        continue;
      }
      place[index(node)] = add_node(first_number++, after.point(node));
      const auto row = rows.begin() + static_cast<std::ptrdiff_t>(index(node) * width);
      if (width > 0)
        joined_.node_values.insert(joined_.node_values.end(), row, row + static_cast<std::ptrdiff_t>(width));
    }
    const auto in_piece = [&](LocalId node) { return place[index(node)]; };
    MeshPiece& piece = joined_.piece;
    std::transform(after.element_nodes.begin(), after.element_nodes.end(), std::back_inserter(piece.element_nodes),
                   in_piece);
    piece.element_region.insert(piece.element_region.end(), after.element_region.begin(), after.element_region.end());
    for (LocalId f = 0; f < after.facets(); ++f) {
      if (after.facet_group[index(f)] < 0) continue;
      const auto first = after.facet_nodes.begin() + static_cast<std::ptrdiff_t>(f) * mesh_.dim;
      std::transform(first, first + mesh_.dim, std::back_inserter(piece.facet_nodes), in_piece);
      piece.facet_group.push_back(after.facet_group[index(f)]);
    }
    const std::vector<Real> elements = values.element_rows();
    joined_.element_values.insert(joined_.element_values.end(), elements.begin(), elements.end());
  }

  const FieldedPiece& piece() const { return joined_; }

 private:
  LocalId add_node(GlobalId number, const Real* point) {
    joined_.piece.node_numbers.push_back(number);
    joined_.piece.coordinates.insert(joined_.piece.coordinates.end(), point, point + mesh_.dim);
    return joined_.piece.nodes() - 1;
  }

  FieldStore& fields_;
  const Mesh& mesh_;
  const Cut& cut_;
  FieldedPiece joined_;
  std::vector<LocalId> place_;  ///< [mesh node] in the piece, of those that are kept
};

/// The metric at some nodes of a mesh.
Metric metric_at(const Metric& metric, std::span<const LocalId> nodes, int dim) {
  if (metric.kind() == Metric::Kind::uniform) return metric;
  const auto n = static_cast<std::size_t>(metric.components());
  std::vector<Real> values;
  for (const LocalId node : nodes) {
    const auto first = metric.values().begin() + static_cast<std::ptrdiff_t>(index(node) * n);
    values.insert(values.end(), first, first + static_cast<std::ptrdiff_t>(n));
  }
  return metric.kind() == Metric::Kind::sizes ? Metric::per_node(std::move(values))
                                              : Metric::tensors(dim, std::move(values));
}

}  // namespace

void store_metric(const Mesh& mesh, const Metric& metric, FieldStore& fields) {
  if (fields.has(metric_field_name)) fields.remove(metric_field_name);
  if (metric.kind() == Metric::Kind::uniform) return;
  const bool sizes = metric.kind() == Metric::Kind::sizes;
  Field& field = fields.declare(mesh, {metric_field_name, sizes ? "m" : "1/m^2", Support::node, metric.components(),
                                       Transfer::interpolate, false});
  field.assign(metric.values());
}

Metric stored_metric(const Mesh& mesh, const FieldStore& fields, const Metric& uniform) {
  if (!fields.has(metric_field_name)) return uniform;
  const Field& field = fields[metric_field_name];
  std::vector<Real> values(field.values().begin(), field.values().end());
  return field.components() == 1 ? Metric::per_node(std::move(values)) : Metric::tensors(mesh.dim, std::move(values));
}

std::vector<std::uint8_t> shared_nodes(const Mesh& mesh) {
  std::vector<std::uint8_t> shared(index(mesh.nodes()), 0);
  std::fill(shared.begin() + mesh.owned_nodes(), shared.end(), std::uint8_t{1});
  for (const auto& partner : mesh.node_halo.partners()) {
    for (const LocalId node : partner.sends) shared[index(node)] = 1;
  }
  return shared;
}

RemeshMesh local_arrays(const Mesh& mesh) {
  RemeshMesh arrays;
  arrays.dimension = mesh.dim;
  arrays.coordinates = mesh.coordinates;
  arrays.element_nodes = mesh.element_nodes;
  arrays.element_region = mesh.element_region;
  arrays.facet_nodes = mesh.facet_nodes;
  arrays.facet_group = mesh.facet_group;
  arrays.frozen = shared_nodes(mesh);
  return arrays;
}

RemeshReport remesh_selection(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                              std::span<const std::uint8_t> selected, const Metric& uniform,
                              const RemeshOptions& options) {
  check(selected.size() == index(mesh.elements()), "each element is selected or not");
  const Cut cut(mesh, selected);
  RemeshReport report;
  RemeshMesh after = cut.arrays();
  Metric carried = metric_at(stored_metric(mesh, fields, uniform), cut.nodes(), mesh.dim);
  agree(comm, [&] {
    if (after.elements() == 0) return;
    const Metric wanted = carried;
    report = remesh(after, wanted, options, &carried);
  });
  const GlobalId first_number = mesh.total_nodes() + comm.sum_of_lower_ranks(GlobalId{after.nodes()});
  Joint joint(fields, mesh, cut);
  joint.add_rest();
  joint.add_new(after, first_number, Transferred(fields, mesh, cut, after, carried));
  mesh = assemble_with_fields(comm, joint.piece(), fields);
  return report;
}

}  // namespace malleus
