#include "partition/migrate.hpp"

#include <algorithm>
#include <map>

#include "base/error.hpp"
#include "mesh/assemble.hpp"
#include "parallel/byte_stream.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// What goes to one rank: elements and named facets of this rank, by local index.
struct Load {
  std::vector<LocalId> elements;
  std::vector<LocalId> facets;
};

/// Fields of one support, in the order of the store, side by side.
class FieldColumns {
 public:
  FieldColumns(FieldStore& store, Support support) {
    for (Field* field : store.all()) {
      if (field->spec().support != support) continue;
      fields_.push_back(field);
      width_ += static_cast<std::size_t>(field->components());
    }
  }
  std::size_t width() const { return width_; }
  void append(LocalId entity, std::vector<Real>& row) const {
    for (const Field* field : fields_)
      row.insert(row.end(), field->at(entity), field->at(entity) + field->components());
  }
  /// Puts rows [piece entity][width] in the places given by to[piece entity].
  void scatter(std::span<const Real> rows, std::span<const LocalId> to, std::size_t entities) const {
    std::size_t column = 0;
    for (Field* field : fields_) {
      const auto components = static_cast<std::size_t>(field->components());
      std::vector<Real> values(entities * components);
      for (std::size_t i = 0; i < to.size(); ++i) {
        std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(i * width_ + column), components,
                    values.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(to[i]) * components));
      }
      field->assign(std::move(values));
      column += components;
    }
  }

 private:
  std::vector<Field*> fields_;
  std::size_t width_ = 0;
};

std::map<int, Load> sort_by_destination(const Mesh& mesh, std::span<const int> destinations) {
  std::map<int, Load> loads;
  for (LocalId e = 0; e < mesh.elements(); ++e) loads[destinations[static_cast<std::size_t>(e)]].elements.push_back(e);
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    if (mesh.facet_group[static_cast<std::size_t>(f)] < 0) continue;
    const LocalId element = mesh.facet_element[static_cast<std::size_t>(f)];
    loads[destinations[static_cast<std::size_t>(element)]].facets.push_back(f);
  }
  return loads;
}

std::vector<std::byte> pack(const Mesh& mesh, const Load& load, const FieldColumns& node_fields,
                            const FieldColumns& element_fields, std::vector<LocalId>& place) {
  std::vector<GlobalId> numbers;
  std::vector<Real> coordinates, node_values, element_values;
  std::vector<LocalId> connectivity, facet_nodes, listed;
  std::vector<std::int32_t> regions, facet_groups;
  std::vector<GlobalId> ids;
  for (const LocalId element : load.elements) {
    for (const LocalId node : mesh.nodes_of_element(element)) {
      LocalId& index = place[static_cast<std::size_t>(node)];
      if (index < 0) {
        index = static_cast<LocalId>(listed.size());
        listed.push_back(node);
      }
      connectivity.push_back(index);
    }
    regions.push_back(mesh.element_region[static_cast<std::size_t>(element)]);
    if (!mesh.element_ids.empty()) ids.push_back(mesh.element_ids[static_cast<std::size_t>(element)]);
    element_fields.append(element, element_values);
  }
  for (const LocalId facet : load.facets) {
    for (const LocalId node : mesh.nodes_of_facet(facet)) facet_nodes.push_back(place[static_cast<std::size_t>(node)]);
    facet_groups.push_back(mesh.facet_group[static_cast<std::size_t>(facet)]);
  }
  for (const LocalId node : listed) {
    numbers.push_back(mesh.global_node(node));
    coordinates.insert(coordinates.end(), mesh.point(node), mesh.point(node) + mesh.dim);
    node_fields.append(node, node_values);
    place[static_cast<std::size_t>(node)] = -1;
  }
  ByteWriter writer;
  writer.put_list<GlobalId>(numbers);
  writer.put_list<Real>(coordinates);
  writer.put_list<Real>(node_values);
  writer.put_list<LocalId>(connectivity);
  writer.put_list<std::int32_t>(regions);
  writer.put_list<GlobalId>(ids);
  writer.put_list<Real>(element_values);
  writer.put_list<LocalId>(facet_nodes);
  writer.put_list<std::int32_t>(facet_groups);
  return writer.take();
}

/// The pieces from several ranks in one, nodes that came more than once merged (the lowest sender's copy stays).
struct Received {
  MeshPiece piece;
  std::vector<Real> node_values;
  std::vector<Real> element_values;
};

template <class T>
void append(std::vector<T>& target, const std::vector<T>& more) {
  target.insert(target.end(), more.begin(), more.end());
}

/// The place of each node number in the order of first arrival.
std::vector<std::pair<GlobalId, LocalId>> merge_numbers(const std::vector<std::vector<GlobalId>>& lists,
                                                        std::vector<std::vector<LocalId>>& places) {
  std::vector<std::pair<GlobalId, std::pair<std::size_t, std::size_t>>> all;
  for (std::size_t list = 0; list < lists.size(); ++list) {
    places[list].assign(lists[list].size(), -1);
    for (std::size_t i = 0; i < lists[list].size(); ++i) all.push_back({lists[list][i], {list, i}});
  }
  std::sort(all.begin(), all.end());
  std::vector<std::pair<GlobalId, LocalId>> merged;
  for (const auto& [number, origin] : all) {
    if (merged.empty() || merged.back().first != number) {
      merged.emplace_back(number, static_cast<LocalId>(merged.size()));
    }
    places[origin.first][origin.second] = merged.back().second;
  }
  return merged;
}

Received unpack(const Mesh& mesh, const std::vector<Parcel>& parcels, std::size_t node_width) {
  const auto dim = static_cast<std::size_t>(mesh.dim);
  Received received;
  MeshPiece& piece = received.piece;
  piece.dim = mesh.dim;
  piece.region_names = mesh.region_names;
  piece.group_names = mesh.group_names;
  std::vector<ByteReader> readers;
  std::vector<std::vector<GlobalId>> numbers;
  for (const Parcel& parcel : parcels) numbers.push_back(readers.emplace_back(parcel.bytes).get_list<GlobalId>());
  std::vector<std::vector<LocalId>> places(numbers.size());
  for (const auto& [number, place] : merge_numbers(numbers, places)) piece.node_numbers.push_back(number);
  piece.coordinates.resize(piece.node_numbers.size() * dim);
  received.node_values.resize(piece.node_numbers.size() * node_width);
  for (std::size_t p = readers.size(); p-- > 0;) {
    const auto coordinates = readers[p].get_list<Real>();
    const auto values = readers[p].get_list<Real>();
    for (std::size_t i = 0; i < places[p].size(); ++i) {
      const auto place = static_cast<std::size_t>(places[p][i]);
      std::copy_n(coordinates.data() + i * dim, dim, piece.coordinates.data() + place * dim);
      if (node_width > 0)
        std::copy_n(values.data() + i * node_width, node_width, received.node_values.data() + place * node_width);
    }
  }
  for (std::size_t p = 0; p < readers.size(); ++p) {
    for (const LocalId node : readers[p].get_list<LocalId>()) {
      piece.element_nodes.push_back(places[p][static_cast<std::size_t>(node)]);
    }
    append(piece.element_region, readers[p].get_list<std::int32_t>());
    append(piece.element_ids, readers[p].get_list<GlobalId>());
    append(received.element_values, readers[p].get_list<Real>());
    for (const LocalId node : readers[p].get_list<LocalId>()) {
      piece.facet_nodes.push_back(places[p][static_cast<std::size_t>(node)]);
    }
    append(piece.facet_group, readers[p].get_list<std::int32_t>());
  }
  return received;
}

}  // namespace

MigrationReport migrate(const Communicator& comm, Mesh& mesh, FieldStore& fields, std::span<const int> destinations) {
  check(destinations.size() == static_cast<std::size_t>(mesh.elements()), "each element has a destination");
  MigrationReport report;
  report.moved_elements = comm.sum(static_cast<GlobalId>(
      std::count_if(destinations.begin(), destinations.end(), [&](int rank) { return rank != comm.rank(); })));
  if (report.moved_elements == 0) return report;

  const FieldColumns node_fields(fields, Support::node);
  const FieldColumns element_fields(fields, Support::element);
  std::vector<LocalId> place(static_cast<std::size_t>(mesh.nodes()), -1);
  std::vector<Parcel> outgoing;
  GlobalId sent = 0;
  for (const auto& [rank, load] : sort_by_destination(mesh, destinations)) {
    outgoing.push_back({rank, pack(mesh, load, node_fields, element_fields, place)});
    if (rank != comm.rank()) sent += static_cast<GlobalId>(outgoing.back().bytes.size());
  }
  report.sent_bytes = comm.sum(sent);
  const Received received = unpack(mesh, sparse_exchange(comm, std::move(outgoing)), node_fields.width());

  AssembledMesh assembled = assemble_mesh(comm, received.piece);
  mesh = std::move(assembled.mesh);
  node_fields.scatter(received.node_values, assembled.node_of_piece, FieldStore::entities(mesh, Support::node));
  element_fields.scatter(received.element_values, assembled.element_of_piece,
                         FieldStore::entities(mesh, Support::element));
  return report;
}

}  // namespace malleus
