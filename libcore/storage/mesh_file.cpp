#include "storage/mesh_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "parallel/agreement.hpp"
#include "storage/atomic_file.hpp"
#include "storage/field_list.hpp"
#include "storage/h5_file.hpp"
#include "storage/seal.hpp"
#include "storage/shared_h5_file.hpp"

namespace malleus {
namespace {

namespace fs = std::filesystem;
constexpr int format_version = 2;

std::string group_of(GlobalId part) {
  return fmt::format("/p{:04d}", part);
}

/// The arrays of one partition under their names in the file.
struct PartArrays {
  std::vector<double> points;              ///< [node][dim]
  std::vector<std::int64_t> node_numbers;  ///< global
  std::vector<std::int32_t> cells;         ///< [element][dim+1], places in points
  std::vector<std::int32_t> region;
  std::vector<std::int64_t> element_ids;  ///< empty, or one an element
  std::vector<std::int32_t> facets;       ///< [named facet][dim]
  std::vector<std::int32_t> facet_group;
  std::vector<std::vector<double>> fields;  ///< in the order of the field list
};

/// The entities of one part of this rank's mesh, by local index, increasing.
struct PartEntities {
  std::vector<LocalId> elements;
  std::vector<LocalId> nodes;
  std::vector<LocalId> facets;  ///< those with a group
};

/// The entities of the parts [first, last) of this rank. parts: [element].
std::vector<PartEntities> entities_of_parts(const Mesh& mesh, std::span<const int> parts, int first, int last) {
  std::vector<PartEntities> entities(static_cast<std::size_t>(last - first));
  const auto of = [&](LocalId element) -> PartEntities& {
    const int part = parts[static_cast<std::size_t>(element)];
    check(part >= first && part < last, "a part lies on the rank that writes it");
    return entities[static_cast<std::size_t>(part - first)];
  };
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    PartEntities& part = of(e);
    part.elements.push_back(e);
    const auto nodes = mesh.nodes_of_element(e);
    part.nodes.insert(part.nodes.end(), nodes.begin(), nodes.end());
  }
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    if (mesh.facet_group[static_cast<std::size_t>(f)] < 0) continue;
    of(mesh.facet_element[static_cast<std::size_t>(f)]).facets.push_back(f);
  }
  for (PartEntities& part : entities) {
    std::sort(part.nodes.begin(), part.nodes.end());
    part.nodes.erase(std::unique(part.nodes.begin(), part.nodes.end()), part.nodes.end());
  }
  return entities;
}

/// Places of mesh nodes in a part's list.
std::vector<std::int32_t> places_in(std::span<const LocalId> list, std::span<const LocalId> nodes) {
  std::vector<std::int32_t> places;
  for (const LocalId node : nodes) {
    places.push_back(static_cast<std::int32_t>(std::lower_bound(list.begin(), list.end(), node) - list.begin()));
  }
  return places;
}

std::vector<double> values_of(const Field& field, const PartEntities& part) {
  const auto values = field.values();
  if (field.spec().support == Support::domain) return {values.begin(), values.end()};
  const std::vector<LocalId>& entities = field.spec().support == Support::node ? part.nodes : part.elements;
  std::vector<double> rows;
  for (const LocalId entity : entities)
    rows.insert(rows.end(), field.at(entity), field.at(entity) + field.components());
  return rows;
}

template <class T>
void append_place(std::vector<std::int32_t>& target, std::span<const LocalId> list, const T& nodes) {
  const std::vector<std::int32_t> places = places_in(list, nodes);
  target.insert(target.end(), places.begin(), places.end());
}

PartArrays arrays_of(const Mesh& mesh, const FieldStore& fields, const PartEntities& entities) {
  PartArrays part;
  for (const LocalId node : entities.nodes) {
    part.points.insert(part.points.end(), mesh.point(node), mesh.point(node) + mesh.dim);
    part.node_numbers.push_back(mesh.global_node(node));
  }
  for (const LocalId e : entities.elements) {
    append_place(part.cells, entities.nodes, mesh.nodes_of_element(e));
    part.region.push_back(mesh.element_region[static_cast<std::size_t>(e)]);
    if (!mesh.element_ids.empty()) part.element_ids.push_back(mesh.element_ids[static_cast<std::size_t>(e)]);
  }
  for (const LocalId f : entities.facets) {
    append_place(part.facets, entities.nodes, mesh.nodes_of_facet(f));
    part.facet_group.push_back(mesh.facet_group[static_cast<std::size_t>(f)]);
  }
  for (const Field* field : fields.all()) part.fields.push_back(values_of(*field, entities));
  return part;
}

/// Sizes that every rank must know of every partition, so that all can make its datasets.
struct PartSizes {
  GlobalId nodes, elements, ids, facets;
};

/// The sizes of all parts on all ranks; `arrays` are those of the parts from `first` on. Collective.
std::vector<PartSizes> gather_sizes(const Communicator& comm, const std::vector<PartArrays>& arrays, int first,
                                    int n_parts) {
  constexpr std::size_t entries = 4;
  std::vector<GlobalId> table(static_cast<std::size_t>(n_parts) * entries, 0);
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    const PartArrays& part = arrays[i];
    const std::array<GlobalId, entries> row = {
        static_cast<GlobalId>(part.node_numbers.size()), static_cast<GlobalId>(part.region.size()),
        static_cast<GlobalId>(part.element_ids.size()), static_cast<GlobalId>(part.facet_group.size())};
    std::copy(row.begin(), row.end(), table.begin() + static_cast<std::ptrdiff_t>((first + i) * entries));
  }
  comm.sum_in_place(std::span<GlobalId>(table));
  std::vector<PartSizes> sizes;
  for (std::size_t i = 0; i < table.size(); i += entries) {
    sizes.push_back({table[i], table[i + 1], table[i + 2], table[i + 3]});
  }
  return sizes;
}

void make_part(SharedH5File& file, GlobalId part, const PartSizes& sizes, int dim, const FieldStore& fields) {
  using Type = SharedH5File::Type;
  const std::string group = group_of(part);
  const auto u = [](GlobalId value) { return static_cast<std::uint64_t>(value); };
  file.make_group(group);
  file.make_dataset(group + "/points", Type::float64, {u(sizes.nodes), u(dim)});
  file.make_dataset(group + "/node_numbers", Type::int64, {u(sizes.nodes)});
  file.make_dataset(group + "/cells", Type::int32, {u(sizes.elements), u(dim) + 1});
  file.make_dataset(group + "/region", Type::int32, {u(sizes.elements)});
  file.make_dataset(group + "/element_ids", Type::int64, {u(sizes.ids)});
  file.make_dataset(group + "/facets", Type::int32, {u(sizes.facets), u(dim)});
  file.make_dataset(group + "/facet_group", Type::int32, {u(sizes.facets)});
  for (const Field* field : fields.all()) {
    const Support support = field->spec().support;
    const GlobalId entities = support == Support::node ? sizes.nodes : support == Support::element ? sizes.elements : 1;
    file.make_dataset(group + "/" + field->spec().name, Type::float64, {u(entities), u(field->components())});
  }
}

void write_part(SharedH5File& file, GlobalId part, const PartArrays& arrays, const FieldStore& fields) {
  const std::string group = group_of(part);
  file.write(group + "/points", arrays.points);
  file.write(group + "/node_numbers", arrays.node_numbers);
  file.write(group + "/cells", arrays.cells);
  file.write(group + "/region", arrays.region);
  file.write(group + "/element_ids", arrays.element_ids);
  file.write(group + "/facets", arrays.facets);
  file.write(group + "/facet_group", arrays.facet_group);
  std::size_t i = 0;
  for (const Field* field : fields.all()) file.write(group + "/" + field->spec().name, arrays.fields[i++]);
}

std::string xdmf_text(const std::string& file, const nlohmann::json& head, const std::vector<PartSizes>& parts) {
  const int dim = head.at("dim");
  const auto item = [&](GlobalId part, const std::string& name, const std::string& dims, const char* type, int bytes) {
    return fmt::format(R"(<DataItem Dimensions="{}" NumberType="{}" Precision="{}" Format="HDF">{}:{}/{}</DataItem>)",
                       dims, type, bytes, file, group_of(part), name);
  };
  std::string xml =
      "<?xml version=\"1.0\" ?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"3.0\">\n<Domain>\n"
      "<Grid Name=\"mesh\" GridType=\"Collection\" CollectionType=\"Spatial\">\n";
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto part = static_cast<GlobalId>(p);
    if (parts[p].elements == 0) continue;
    xml += fmt::format(
        "<Grid Name=\"p{:04d}\" GridType=\"Uniform\">\n<Topology TopologyType=\"{}\" "
        "NumberOfElements=\"{}\">{}</Topology>\n",
        part, dim == 3 ? "Tetrahedron" : "Triangle", parts[p].elements,
        item(part, "cells", fmt::format("{} {}", parts[p].elements, dim + 1), "Int", 4));
    xml += fmt::format("<Geometry GeometryType=\"{}\">{}</Geometry>\n", dim == 3 ? "XYZ" : "XY",
                       item(part, "points", fmt::format("{} {}", parts[p].nodes, dim), "Float", 8));
    xml += fmt::format("<Attribute Name=\"region\" AttributeType=\"Scalar\" Center=\"Cell\">{}</Attribute>\n",
                       item(part, "region", fmt::format("{}", parts[p].elements), "Int", 4));
    for (const auto& field : head.at("fields")) {
      const int components = field.at("components");
      const auto support = static_cast<Support>(field.at("support").get<int>());
      const bool is_shown = support != Support::domain && (components == 1 || (components == 3 && dim == 3));
      if (!is_shown) continue;
      const GlobalId entities = support == Support::node ? parts[p].nodes : parts[p].elements;
      const std::string name = field.at("name");
      xml += fmt::format("<Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", name,
                         components == 1 ? "Scalar" : "Vector", support == Support::node ? "Node" : "Cell",
                         item(part, name, fmt::format("{} {}", entities, components), "Float", 8));
    }
    xml += "</Grid>\n";
  }
  return xml + "</Grid>\n</Domain>\n</Xdmf>\n";
}

nlohmann::json describe(const Mesh& mesh, const FieldStore& fields, int parts) {
  return {{"format", format_version},
          {"dim", mesh.dim},
          {"parts", parts},
          {"nodes", mesh.total_nodes()},
          {"elements", mesh.total_elements},
          {"region_names", mesh.region_names},
          {"group_names", mesh.group_names},
          {"fields", describe_fields(fields)}};
}

/// The description of a file of ours.
nlohmann::json read_head(const H5File& file, const fs::path& path) {
  if (!file.has("/malleus_mesh")) throw InputError(fmt::format("{}: is no mesh file of Malleus", path.string()));
  const std::vector<std::int32_t> letters = file.read_int32("/malleus_mesh");
  nlohmann::json head = nlohmann::json::parse(std::string(letters.begin(), letters.end()));
  if (head.at("format").get<int>() != format_version) {
    throw InputError(fmt::format("{}: is of an unknown format version", path.string()));
  }
  return head;
}

FieldedPiece read_part(const H5File& file, const nlohmann::json& head, GlobalId number, Real length_unit) {
  const std::string group = group_of(number);
  const std::vector<FieldSpec> specs = field_specs(head.at("fields"));
  PartArrays part;
  part.points = file.read_doubles(group + "/points");
  part.node_numbers = file.read_int64(group + "/node_numbers");
  part.cells = file.read_int32(group + "/cells");
  part.region = file.read_int32(group + "/region");
  part.element_ids = file.read_int64(group + "/element_ids");
  part.facets = file.read_int32(group + "/facets");
  part.facet_group = file.read_int32(group + "/facet_group");
  for (const FieldSpec& spec : specs) part.fields.push_back(file.read_doubles(group + "/" + spec.name));
  FieldedPiece loose;
  loose.piece.dim = head.at("dim");
  loose.piece.node_numbers = std::move(part.node_numbers);
  loose.piece.coordinates = std::move(part.points);
  for (Real& coordinate : loose.piece.coordinates) coordinate *= length_unit;
  loose.piece.element_nodes = std::move(part.cells);
  loose.piece.element_region = std::move(part.region);
  loose.piece.element_ids = std::move(part.element_ids);
  loose.piece.facet_nodes = std::move(part.facets);
  loose.piece.facet_group = std::move(part.facet_group);
  loose.node_values = interleave_fields(specs, part.fields, Support::node, loose.piece.node_numbers.size());
  loose.element_values = interleave_fields(specs, part.fields, Support::element, loose.piece.element_region.size());
  return loose;
}

/// Elements without a place in an earlier file get their place in this one. Collective.
void number_elements(const Communicator& comm, std::vector<FieldedPiece>& pieces) {
  GlobalId mine = 0;
  GlobalId numbered = 0;
  for (const FieldedPiece& part : pieces) {
    mine += part.piece.elements();
    numbered += static_cast<GlobalId>(part.piece.element_ids.size());
  }
  GlobalId next = comm.sum_of_lower_ranks(mine);
  if (comm.sum(numbered) > 0) return;
  for (FieldedPiece& part : pieces) {
    part.piece.element_ids.resize(part.piece.element_region.size());
    for (GlobalId& id : part.piece.element_ids) id = next++;
  }
}

/// The description, read once and known to all ranks.
nlohmann::json shared_head(const Communicator& comm, const fs::path& path) {
  require_seal(comm, path);
  std::string text;
  on_root(comm, [&] {
    try {
      text = read_head(H5File(path, H5File::Mode::read), path).dump();
    } catch (const StorageError& error) {
      throw InputError(error.what());
    } catch (const nlohmann::json::exception& error) {
      throw InputError(fmt::format("{}: damaged description: {}", path.string(), error.what()));
    }
  });
  comm.broadcast(text);
  return nlohmann::json::parse(text);
}

std::vector<FieldedPiece> read_my_parts(const Communicator& comm, const fs::path& path, const nlohmann::json& head,
                                        Real length_unit) {
  FieldedPiece names;
  names.piece.dim = head.at("dim");
  names.piece.region_names = head.at("region_names").get<std::vector<std::string>>();
  names.piece.group_names = head.at("group_names").get<std::vector<std::string>>();
  std::vector<FieldedPiece> pieces = {std::move(names)};
  const int parts = head.at("parts");
  agree(comm, [&] {
    try {
      const H5File file(path, H5File::Mode::read);
      for (int p = first_part_of_rank(parts, comm.rank(), comm.size());
           p < first_part_of_rank(parts, comm.rank() + 1, comm.size()); ++p) {
        pieces.push_back(read_part(file, head, p, length_unit));
      }
    } catch (const StorageError& error) {
      throw InputError(error.what());
    }
  });
  return pieces;
}

}  // namespace

void write_mesh_file(const Communicator& comm, const fs::path& path, const Mesh& mesh, const FieldStore& fields) {
  const std::vector<int> parts(static_cast<std::size_t>(mesh.elements()), comm.rank());
  write_mesh_file(comm, path, mesh, fields, parts, comm.size());
}

void write_mesh_file(const Communicator& comm, const fs::path& path, const Mesh& mesh, const FieldStore& fields,
                     std::span<const int> parts, int n_parts) {
  const int first = first_part_of_rank(n_parts, comm.rank(), comm.size());
  const int last = first_part_of_rank(n_parts, comm.rank() + 1, comm.size());
  std::vector<PartArrays> arrays;
  for (const PartEntities& part : entities_of_parts(mesh, parts, first, last)) {
    arrays.push_back(arrays_of(mesh, fields, part));
  }
  const std::vector<PartSizes> sizes = gather_sizes(comm, arrays, first, n_parts);
  const nlohmann::json head = describe(mesh, fields, n_parts);

  fs::path aside = path;
  aside += ".tmp";
  on_root(comm, [&] {
    H5File file(aside, H5File::Mode::create);  // tells of a directory that cannot be written before MPI-IO meets it
    file.close();
  });
  SharedH5File file(comm, aside);
  for (std::size_t p = 0; p < sizes.size(); ++p) {
    make_part(file, static_cast<GlobalId>(p), sizes[p], mesh.dim, fields);
  }
  const std::string text = head.dump();
  file.make_dataset("/malleus_mesh", SharedH5File::Type::int32, {text.size()});
  agree(comm, [&] {
    for (int p = first; p < last; ++p) write_part(file, p, arrays[static_cast<std::size_t>(p - first)], fields);
    const std::vector<std::int32_t> letters(text.begin(), text.end());
    if (comm.is_root()) file.write("/malleus_mesh", letters);
  });
  file.close();
  on_root(comm, [&] {
    seal_file(aside);
    flush_to_disk(aside);
    std::error_code error;
    fs::rename(aside, path, error);
    if (error) throw StorageError(fmt::format("{}: cannot be renamed: {}", aside.string(), error.message()));
    fs::path xdmf = path;
    write_file_atomically(xdmf.replace_extension(".xdmf"), xdmf_text(path.filename().string(), head, sizes));
  });
}

int first_part_of_rank(int n_parts, int rank, int ranks) {
  return static_cast<int>(static_cast<GlobalId>(n_parts) * rank / ranks);
}

Mesh read_mesh_file(const Communicator& comm, const fs::path& path, Real length_unit, FieldStore& fields) {
  const nlohmann::json head = shared_head(comm, path);
  std::vector<FieldedPiece> pieces = read_my_parts(comm, path, head, length_unit);
  number_elements(comm, pieces);
  const Mesh nothing;
  for (const FieldSpec& spec : field_specs(head.at("fields"))) fields.declare(nothing, spec);
  return assemble_with_fields(comm, merge_pieces(pieces), fields);
}

}  // namespace malleus
