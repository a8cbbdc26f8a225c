#include "mesh/msh_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "base/error.hpp"
#include "mesh/file_reader.hpp"
#include "mesh/msh_layout.hpp"
#include "mesh/msh_scanner.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

/// Larger coordinates overflow in volumes and qualities.
constexpr Real largest_coordinate = 1e50;
constexpr GlobalId largest_number = std::numeric_limits<GlobalId>::max() / 4;

/// The exponent is looked at first: comparing with a NaN is an invalid operation.
bool is_coordinate(Real x) {
  constexpr std::uint64_t exponent = 0x7FF0000000000000ULL;
  return (std::bit_cast<std::uint64_t>(x) & exponent) != exponent && std::abs(x) <= largest_coordinate;
}

/// Elements of one dimension as they stand in the file.
struct RawElements {
  std::vector<GlobalId> nodes;
  std::vector<std::int32_t> physical;  ///< 0 = none
};

/// What one rank read: its share of the records of the file.
struct RawMesh {
  std::vector<GlobalId> node_numbers;
  std::vector<Real> points;             ///< [node][3], unit of the file
  std::array<RawElements, 4> elements;  ///< [dimension]
};

/// Part [begin, end) of a stretch of records.
struct Part {
  GlobalId begin = 0;
  GlobalId end = 0;
  GlobalId size() const { return end - begin; }
};

/// This rank's part of each stretch, such that the ranks take equal counts of records, in the order of the file.
template <class Stretch>
std::vector<Part> share_of_rank(const Communicator& comm, const std::vector<Stretch>& stretches) {
  GlobalId total = 0;
  for (const Stretch& stretch : stretches) total += stretch.count;
  const GlobalId ranks = comm.size();
  const auto limit = [&](GlobalId rank) { return total / ranks * rank + total % ranks * rank / ranks; };
  const GlobalId begin = limit(comm.rank());
  const GlobalId end = limit(comm.rank() + 1);
  std::vector<Part> parts;
  GlobalId before = 0;
  for (const Stretch& stretch : stretches) {
    const GlobalId first = std::clamp<GlobalId>(begin - before, 0, stretch.count);
    const GlobalId last = std::clamp<GlobalId>(end - before, first, stretch.count);
    parts.push_back({first, last});
    before += stretch.count;
  }
  return parts;
}

class ShareReader {
 public:
  ShareReader(const std::string& path, const MshLayout& layout) : file_(path), layout_(layout) {}

  void read_nodes(const MshNodeStretch& stretch, Part part, RawMesh& mesh) {
    if (layout_.version == 2) {
      layout_.binary ? read_nodes2_binary(stretch, part, mesh) : read_nodes2_ascii(stretch, part, mesh);
    } else {
      layout_.binary ? read_nodes4_binary(stretch, part, mesh) : read_nodes4_ascii(stretch, part, mesh);
    }
  }

  void read_elements(const MshElementStretch& stretch, Part part, RawMesh& mesh) {
    if (stretch.type == msh_type::point) return;
    if (layout_.version == 2) {
      layout_.binary ? read_elements2_binary(stretch, part, mesh) : read_elements2_ascii(stretch, part, mesh);
    } else {
      layout_.binary ? read_elements4_binary(stretch, part, mesh) : read_elements4_ascii(stretch, part, mesh);
    }
  }

 private:
  void read_nodes2_ascii(const MshNodeStretch& stretch, Part part, RawMesh& mesh);
  void read_nodes2_binary(const MshNodeStretch& stretch, Part part, RawMesh& mesh);
  void read_nodes4_ascii(const MshNodeStretch& stretch, Part part, RawMesh& mesh);
  void read_nodes4_binary(const MshNodeStretch& stretch, Part part, RawMesh& mesh);
  void read_elements2_ascii(const MshElementStretch& stretch, Part part, RawMesh& mesh);
  void read_elements2_binary(const MshElementStretch& stretch, Part part, RawMesh& mesh);
  void read_elements4_ascii(const MshElementStretch& stretch, Part part, RawMesh& mesh);
  void read_elements4_binary(const MshElementStretch& stretch, Part part, RawMesh& mesh);

  void seek_record(GlobalId at, GlobalId line, GlobalId record) {
    if (record > 0) return file_.seek_line(line + record, layout_.line_index);
    file_.seek(at);
    file_.set_line_number(line);
  }
  LineFields next_line(const char* what) {
    const GlobalId line = file_.line_number();
    return {file_, line, file_.read_line(), what};
  }
  template <class Fail>
  void add_number(GlobalId number, RawMesh& mesh, Fail fail) {
    if (number < 0 || number > largest_number) fail(fmt::format("{} cannot be the number of a node", number));
    mesh.node_numbers.push_back(number);
  }
  template <class Fail>
  void add_point(const std::array<Real, 3>& point, RawMesh& mesh, Fail fail) {
    for (const Real x : point) {
      if (!is_coordinate(x)) fail(fmt::format("{} cannot be a coordinate", x));
    }
    mesh.points.insert(mesh.points.end(), point.begin(), point.end());
  }
  template <class Fail>
  void refuse_partitions(std::int64_t tag, Fail fail) {
    if (tag > 0) fail("the mesh was partitioned by gmsh, which is not read: save it unpartitioned");
  }

  FileReader file_;
  const MshLayout& layout_;
};

void ShareReader::read_nodes2_ascii(const MshNodeStretch& stretch, Part part, RawMesh& mesh) {
  seek_record(stretch.tags_at, stretch.tags_line, part.begin);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    LineFields fields = next_line("a node (number x y z)");
    const auto fail = [&](const std::string& what) { fields.fail(what); };
    add_number(fields.get<GlobalId>(), mesh, fail);
    std::array<Real, 3> point;
    for (Real& x : point) x = fields.get<Real>();
    add_point(point, mesh, fail);
    fields.expect_end();
  }
}

void ShareReader::read_nodes2_binary(const MshNodeStretch& stretch, Part part, RawMesh& mesh) {
  constexpr GlobalId record_bytes = 28;
  file_.seek(stretch.tags_at + part.begin * record_bytes);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    const auto fail = [&, at = file_.position()](const std::string& what) { file_.fail_at_byte(at, what); };
    add_number(file_.read_value<std::int32_t>(), mesh, fail);
    add_point(file_.read_value<std::array<Real, 3>>(), mesh, fail);
  }
}

void ShareReader::read_nodes4_ascii(const MshNodeStretch& stretch, Part part, RawMesh& mesh) {
  seek_record(stretch.tags_at, stretch.tags_line, part.begin);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    LineFields fields = next_line("the number of a node");
    add_number(fields.get<GlobalId>(), mesh, [&](const std::string& what) { fields.fail(what); });
    fields.expect_end();
  }
  seek_record(stretch.points_at, stretch.points_line, part.begin);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    LineFields fields = next_line("a node (x y z)");
    std::array<Real, 3> point;
    for (Real& x : point) x = fields.get<Real>();
    for (GlobalId k = 0; k < stretch.parameters; ++k) fields.get<Real>();
    add_point(point, mesh, [&](const std::string& what) { fields.fail(what); });
    fields.expect_end();
  }
}

void ShareReader::read_nodes4_binary(const MshNodeStretch& stretch, Part part, RawMesh& mesh) {
  file_.seek(stretch.tags_at + part.begin * 8);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    const auto fail = [&, at = file_.position()](const std::string& what) { file_.fail_at_byte(at, what); };
    add_number(file_.read_value<GlobalId>(), mesh, fail);
  }
  file_.seek(stretch.points_at + part.begin * 8 * (3 + stretch.parameters));
  for (GlobalId i = part.begin; i < part.end; ++i) {
    const auto fail = [&, at = file_.position()](const std::string& what) { file_.fail_at_byte(at, what); };
    add_point(file_.read_value<std::array<Real, 3>>(), mesh, fail);
    for (GlobalId k = 0; k < stretch.parameters; ++k) file_.read_value<Real>();
  }
}

void ShareReader::read_elements2_ascii(const MshElementStretch& stretch, Part part, RawMesh& mesh) {
  constexpr std::int32_t partitions_tag = 2;  // tags: physical, entity, count of partitions, ...
  seek_record(stretch.at, stretch.line, part.begin);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    LineFields fields = next_line("an element (number type tags nodes)");
    fields.get<GlobalId>();
    const auto type = fields.get<std::int32_t>();
    const int nodes = msh_node_count(type);
    if (nodes == 0) fields.fail(msh_type_refusal(type));
    RawElements& elements = mesh.elements[static_cast<std::size_t>(nodes - 1)];
    const auto tags = fields.get<std::int32_t>();
    std::int32_t physical = 0;
    for (std::int32_t k = 0; k < tags; ++k) {
      const auto tag = fields.get<std::int32_t>();
      if (k == 0) physical = tag;
      if (k == partitions_tag) refuse_partitions(tag, [&](const std::string& what) { fields.fail(what); });
    }
    elements.physical.push_back(physical);
    for (int k = 0; k < nodes; ++k) elements.nodes.push_back(fields.get<GlobalId>());
    fields.expect_end();
  }
}

void ShareReader::read_elements2_binary(const MshElementStretch& stretch, Part part, RawMesh& mesh) {
  const int nodes = msh_node_count(stretch.type);
  RawElements& elements = mesh.elements[static_cast<std::size_t>(nodes - 1)];
  const GlobalId values = 1 + stretch.tags + nodes;
  const GlobalId record_bytes = stretch.header_bytes + 4 * values;
  std::vector<std::int32_t> record(static_cast<std::size_t>(values));
  file_.seek(stretch.at + part.begin * record_bytes);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    const GlobalId at = file_.position();
    if (stretch.header_bytes > 0) file_.read_value<std::array<std::int32_t, 3>>();
    file_.read_bytes(record.data(), 4 * values);
    if (stretch.tags > 2) {
      refuse_partitions(record[3], [&](const std::string& what) { file_.fail_at_byte(at, what); });
    }
    elements.physical.push_back(stretch.tags > 0 ? record[1] : 0);
    elements.nodes.insert(elements.nodes.end(), record.end() - nodes, record.end());
  }
}

void ShareReader::read_elements4_ascii(const MshElementStretch& stretch, Part part, RawMesh& mesh) {
  const int nodes = msh_node_count(stretch.type);
  RawElements& elements = mesh.elements[static_cast<std::size_t>(nodes - 1)];
  seek_record(stretch.at, stretch.line, part.begin);
  for (GlobalId i = part.begin; i < part.end; ++i) {
    LineFields fields = next_line("an element (number nodes)");
    fields.get<GlobalId>();
    for (int k = 0; k < nodes; ++k) elements.nodes.push_back(fields.get<GlobalId>());
    elements.physical.push_back(stretch.physical);
    fields.expect_end();
  }
}

void ShareReader::read_elements4_binary(const MshElementStretch& stretch, Part part, RawMesh& mesh) {
  const int nodes = msh_node_count(stretch.type);
  RawElements& elements = mesh.elements[static_cast<std::size_t>(nodes - 1)];
  file_.seek(stretch.at + part.begin * 8 * (1 + nodes));
  for (GlobalId i = part.begin; i < part.end; ++i) {
    std::array<GlobalId, 5> record;  // number, nodes
    file_.read_bytes(record.data(), GlobalId{8} * (1 + nodes));
    elements.nodes.insert(elements.nodes.end(), record.begin() + 1, record.begin() + 1 + nodes);
    elements.physical.push_back(stretch.physical);
  }
}

RawMesh read_share(const Communicator& comm, const std::string& path, const MshLayout& layout) {
  RawMesh mesh;
  agree(comm, [&] {
    ShareReader reader(path, layout);
    const std::vector<Part> node_parts = share_of_rank(comm, layout.nodes);
    for (std::size_t i = 0; i < node_parts.size(); ++i) {
      if (node_parts[i].size() > 0) reader.read_nodes(layout.nodes[i], node_parts[i], mesh);
    }
    const std::vector<Part> element_parts = share_of_rank(comm, layout.elements);
    for (std::size_t i = 0; i < element_parts.size(); ++i) {
      if (element_parts[i].size() > 0) reader.read_elements(layout.elements[i], element_parts[i], mesh);
    }
  });
  return mesh;
}

/// Physical tags that the elements of one dimension carry on any rank, increasing; 0 where some have none.
std::vector<std::int32_t> used_tags(const Communicator& comm, const RawElements& elements) {
  const std::set<std::int32_t> mine(elements.physical.begin(), elements.physical.end());
  const std::string packed(mine.empty() ? "" : fmt::format("{} ", fmt::join(mine, " ")));
  std::string all;
  for (const std::string& text : comm.gather_to_root(packed)) all += text;
  comm.broadcast(all);
  std::set<std::int32_t> tags;
  for (const char* next = all.data(); next < all.data() + all.size();) {
    std::int32_t tag = 0;
    next = std::from_chars(next, all.data() + all.size(), tag).ptr + 1;
    tags.insert(tag);
  }
  return {tags.begin(), tags.end()};
}

/// Names of physical groups of one dimension, and the way from tags to them.
struct Groups {
  std::vector<std::string> names;
  std::map<std::int32_t, std::int32_t> of_tag;  ///< tag -> index in names
};

/// gmsh gives negative tags to entities of turned orientation in a group.
Groups name_groups(const MshLayout& layout, int dim, std::span<const std::int32_t> tags) {
  Groups groups;
  for (const std::int32_t tag : tags) {
    if (tag == 0) continue;
    const auto found = layout.names.find({dim, std::abs(tag)});
    const std::string name = found != layout.names.end() ? found->second : std::to_string(std::abs(tag));
    const auto known = std::find(groups.names.begin(), groups.names.end(), name);
    groups.of_tag[tag] = static_cast<std::int32_t>(known - groups.names.begin());
    if (known == groups.names.end()) groups.names.push_back(name);
  }
  return groups;
}

void set_regions(const Communicator& comm, const MshLayout& layout, const RawElements& elements, MeshChunk& chunk) {
  const std::vector<std::int32_t> tags = used_tags(comm, elements);
  Groups groups = name_groups(layout, chunk.dim, tags);
  const GlobalId unnamed =
      comm.sum(static_cast<GlobalId>(std::count(elements.physical.begin(), elements.physical.end(), std::int32_t{0})));
  if (unnamed > 0 && !groups.names.empty()) {
    const char* kind = chunk.dim == 3 ? "tetrahedra are in no physical volume" : "triangles are in no physical surface";
    throw InputError(fmt::format("{}: {} {}, though the file has such groups ({}): put every element in one",
                                 chunk.source, unnamed, kind, fmt::join(groups.names, ", ")));
  }
  if (groups.names.empty()) {
    groups.names = {"default"};
    groups.of_tag[0] = 0;
  }
  chunk.region_names = groups.names;
  for (const std::int32_t tag : elements.physical) chunk.element_region.push_back(groups.of_tag.at(tag));
}

void set_groups(const Communicator& comm, const MshLayout& layout, const RawElements& facets, MeshChunk& chunk) {
  const Groups groups = name_groups(layout, chunk.dim - 1, used_tags(comm, facets));
  chunk.group_names = groups.names;
  const auto n = static_cast<std::ptrdiff_t>(chunk.dim);
  for (std::size_t f = 0; f < facets.physical.size(); ++f) {
    if (facets.physical[f] == 0) continue;
    const auto first = facets.nodes.begin() + static_cast<std::ptrdiff_t>(f) * n;
    chunk.facet_nodes.insert(chunk.facet_nodes.end(), first, first + n);
    chunk.facet_group.push_back(groups.of_tag.at(facets.physical[f]));
  }
}

void refuse_uneven_plane(const Communicator& comm, const RawMesh& raw, const std::string& path) {
  std::array<Real, 3> low = {largest_coordinate, largest_coordinate, largest_coordinate};
  std::array<Real, 3> high = {-largest_coordinate, -largest_coordinate, -largest_coordinate};
  for (std::size_t i = 0; i < raw.points.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], raw.points[i]);
    high[i % 3] = std::max(high[i % 3], raw.points[i]);
  }
  comm.min_in_place(low);
  comm.max_in_place(high);
  constexpr Real roundoff = 1e-9;
  if (high[2] - low[2] <= roundoff * std::max(high[0] - low[0], high[1] - low[1])) return;
  throw InputError(
      fmt::format("{}: the mesh has triangles, no tetrahedra, and z runs from {} to {}: a mesh in two "
                  "dimensions lies in a plane z = constant, one in three has tetrahedra",
                  path, low[2], high[2]));
}

int mesh_dimension(const Communicator& comm, const RawMesh& raw, const std::string& path) {
  if (comm.any(!raw.elements[3].physical.empty())) return 3;
  if (!comm.any(!raw.elements[2].physical.empty())) {
    throw InputError(fmt::format("{}: the file has neither tetrahedra nor triangles", path));
  }
  refuse_uneven_plane(comm, raw, path);
  return 2;
}

void set_points(const RawMesh& raw, Real length_unit, MeshChunk& chunk) {
  const auto dim = static_cast<std::size_t>(chunk.dim);
  chunk.coordinates.reserve(raw.node_numbers.size() * dim);
  for (std::size_t i = 0; i < raw.points.size(); ++i) {
    if (i % 3 < dim) chunk.coordinates.push_back(raw.points[i] * length_unit);
  }
}

RawMesh read_whole(const std::string& path) {
  RawMesh mesh;
  const MshLayout layout = scan_msh(path);
  ShareReader reader(path, layout);
  for (const MshNodeStretch& stretch : layout.nodes) reader.read_nodes(stretch, {0, stretch.count}, mesh);
  for (const MshElementStretch& stretch : layout.elements) reader.read_elements(stretch, {0, stretch.count}, mesh);
  return mesh;
}

}  // namespace

MshSurface read_msh_surface(const std::string& path, int facet_nodes) {
  check(facet_nodes == 2 || facet_nodes == 3, "facets are lines or triangles");
  const RawMesh raw = read_whole(path);
  MshSurface surface;
  std::map<GlobalId, LocalId> place;
  for (std::size_t i = 0; i < raw.node_numbers.size(); ++i) {
    if (!place.emplace(raw.node_numbers[i], static_cast<LocalId>(i)).second) {
      throw InputError(fmt::format("{}: node {} stands twice in the file", path, raw.node_numbers[i]));
    }
    surface.points.push_back({raw.points[3 * i], raw.points[3 * i + 1], raw.points[3 * i + 2]});
  }
  const std::vector<GlobalId>& nodes = raw.elements[static_cast<std::size_t>(facet_nodes - 1)].nodes;
  const auto count = static_cast<std::size_t>(facet_nodes);
  for (std::size_t first = 0; first < nodes.size(); first += count) {
    std::array<LocalId, 3> facet = {-1, -1, -1};
    for (std::size_t k = 0; k < count; ++k) {
      const auto found = place.find(nodes[first + k]);
      if (found == place.end()) {
        throw InputError(
            fmt::format("{}: an element names node {}, which the file does not have", path, nodes[first + k]));
      }
      facet[k] = found->second;
    }
    surface.facets.push_back(facet);
  }
  return surface;
}

MeshChunk read_msh(const Communicator& comm, const std::string& path, Real length_unit) {
  check(length_unit > 0, "the unit of length is positive");
  const MshLayout layout = find_msh_layout(comm, path);
  RawMesh raw = read_share(comm, path, layout);
  MeshChunk chunk;
  chunk.source = path;
  chunk.dim = mesh_dimension(comm, raw, path);
  chunk.node_numbers = std::move(raw.node_numbers);
  set_points(raw, length_unit, chunk);
  raw.points = {};
  RawElements& elements = raw.elements[static_cast<std::size_t>(chunk.dim)];
  set_regions(comm, layout, elements, chunk);
  set_groups(comm, layout, raw.elements[static_cast<std::size_t>(chunk.dim - 1)], chunk);
  chunk.element_nodes = std::move(elements.nodes);
  const GlobalId first = comm.sum_of_lower_ranks(static_cast<GlobalId>(chunk.element_region.size()));
  chunk.element_ids.resize(chunk.element_region.size());
  std::iota(chunk.element_ids.begin(), chunk.element_ids.end(), first);
  return chunk;
}

}  // namespace malleus
