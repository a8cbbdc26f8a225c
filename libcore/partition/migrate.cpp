#include "partition/migrate.hpp"

#include <algorithm>
#include <map>

#include "base/error.hpp"
#include "field/fielded_piece.hpp"
#include "parallel/byte_stream.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// What goes to one rank: elements and named facets of this rank, by local index.
struct Load {
  std::vector<LocalId> elements;
  std::vector<LocalId> facets;
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

/// Cuts loads out of the mesh, one after another.
class Cutter {
 public:
  Cutter(const Mesh& mesh, FieldStore& fields)
      : mesh_(mesh),
        node_fields_(fields, Support::node),
        element_fields_(fields, Support::element),
        place_(static_cast<std::size_t>(mesh.nodes()), -1) {}

  FieldedPiece cut(const Load& load) {
    FieldedPiece cut;
    std::vector<LocalId> listed;
    for (const LocalId element : load.elements) add_element(element, cut, listed);
    for (const LocalId facet : load.facets) {
      for (const LocalId node : mesh_.nodes_of_facet(facet)) cut.piece.facet_nodes.push_back(place(node));
      cut.piece.facet_group.push_back(mesh_.facet_group[static_cast<std::size_t>(facet)]);
    }
    for (const LocalId node : listed) {
      cut.piece.node_numbers.push_back(mesh_.global_node(node));
      cut.piece.coordinates.insert(cut.piece.coordinates.end(), mesh_.point(node), mesh_.point(node) + mesh_.dim);
      node_fields_.append(node, cut.node_values);
      place(node) = -1;
    }
    return cut;
  }

 private:
  LocalId& place(LocalId node) { return place_[static_cast<std::size_t>(node)]; }

  void add_element(LocalId element, FieldedPiece& cut, std::vector<LocalId>& listed) {
    for (const LocalId node : mesh_.nodes_of_element(element)) {
      if (place(node) < 0) {
        place(node) = static_cast<LocalId>(listed.size());
        listed.push_back(node);
      }
      cut.piece.element_nodes.push_back(place(node));
    }
    cut.piece.element_region.push_back(mesh_.element_region[static_cast<std::size_t>(element)]);
    if (!mesh_.element_ids.empty())
      cut.piece.element_ids.push_back(mesh_.element_ids[static_cast<std::size_t>(element)]);
    element_fields_.append(element, cut.element_values);
  }

  const Mesh& mesh_;
  FieldColumns node_fields_;
  FieldColumns element_fields_;
  std::vector<LocalId> place_;  ///< of each mesh node in the piece being cut, -1 elsewhere
};

std::vector<std::byte> to_bytes(const FieldedPiece& cut) {
  ByteWriter writer;
  writer.put_list<GlobalId>(cut.piece.node_numbers);
  writer.put_list<Real>(cut.piece.coordinates);
  writer.put_list<LocalId>(cut.piece.element_nodes);
  writer.put_list<std::int32_t>(cut.piece.element_region);
  writer.put_list<GlobalId>(cut.piece.element_ids);
  writer.put_list<LocalId>(cut.piece.facet_nodes);
  writer.put_list<std::int32_t>(cut.piece.facet_group);
  writer.put_list<Real>(cut.node_values);
  writer.put_list<Real>(cut.element_values);
  return writer.take();
}

FieldedPiece from_bytes(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  FieldedPiece cut;
  cut.piece.node_numbers = reader.get_list<GlobalId>();
  cut.piece.coordinates = reader.get_list<Real>();
  cut.piece.element_nodes = reader.get_list<LocalId>();
  cut.piece.element_region = reader.get_list<std::int32_t>();
  cut.piece.element_ids = reader.get_list<GlobalId>();
  cut.piece.facet_nodes = reader.get_list<LocalId>();
  cut.piece.facet_group = reader.get_list<std::int32_t>();
  cut.node_values = reader.get_list<Real>();
  cut.element_values = reader.get_list<Real>();
  return cut;
}

}  // namespace

MigrationReport migrate(const Communicator& comm, Mesh& mesh, FieldStore& fields, std::span<const int> destinations,
                        std::size_t piece_bytes) {
  check(destinations.size() == static_cast<std::size_t>(mesh.elements()), "each element has a destination");
  MigrationReport report;
  report.moved_elements = comm.sum(static_cast<GlobalId>(
      std::count_if(destinations.begin(), destinations.end(), [&](int rank) { return rank != comm.rank(); })));
  if (report.moved_elements == 0) return report;

  std::vector<Parcel> outgoing;
  GlobalId sent = 0;
  Cutter cutter(mesh, fields);
  FieldedPiece staying;
  for (const auto& [rank, load] : sort_by_destination(mesh, destinations)) {
    FieldedPiece cut = cutter.cut(load);
    if (rank == comm.rank()) {
      staying = std::move(cut);
      continue;
    }
    outgoing.push_back({rank, to_bytes(cut)});
    sent += static_cast<GlobalId>(outgoing.back().bytes.size());
  }
  report.sent_bytes = comm.sum(sent);

  FieldedPiece names_only;  // so that a rank which receives nothing still knows dimension and names
  names_only.piece.dim = mesh.dim;
  names_only.piece.region_names = mesh.region_names;
  names_only.piece.group_names = mesh.group_names;
  std::vector<FieldedPiece> received = {std::move(names_only)};
  bool has_stayed = false;
  const auto keep_what_stays = [&](int next_rank) {  // in the order of ranks, as it would arrive
    if (has_stayed || next_rank < comm.rank()) return;
    received.push_back(std::move(staying));
    has_stayed = true;
  };
  for (const Parcel& parcel : sparse_exchange(comm, std::move(outgoing), piece_bytes)) {
    keep_what_stays(parcel.rank);
    received.push_back(from_bytes(parcel.bytes));
  }
  keep_what_stays(comm.size());
  mesh = assemble_with_fields(comm, merge_pieces(received), fields);
  return report;
}

}  // namespace malleus
