#include "mesh/medit_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <map>
#include <set>

#include "base/error.hpp"
#include "mesh/file_reader.hpp"
#include "mesh/medit_io.hpp"
#include "mesh/ordered_file.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

/// (dimension, reference) -> name.
using ReferenceNames = std::map<std::pair<int, int>, std::string>;

std::string names_path(const std::string& path) {
  return std::filesystem::path(path).replace_extension(".names").string();
}

/// The names beside a mesh; none where there is no such file.
ReferenceNames read_names(const std::string& path) {
  ReferenceNames names;
  if (!std::filesystem::exists(names_path(path))) return names;
  FileReader file(names_path(path));
  while (!file.at_end()) {
    const GlobalId line = file.line_number();
    LineFields fields(file, line, file.read_line(), "a name (dimension reference name)");
    if (!fields.has_more()) continue;
    const auto dim = fields.get<std::int32_t>();
    const auto reference = fields.get<std::int32_t>();
    if (!fields.has_more()) fields.fail("a name is missing");
    std::string name(fields.rest());
    while (name.back() == '\r' || name.back() == ' ') name.pop_back();
    names[{dim, reference}] = name;
  }
  return names;
}

/// Names of the references of one dimension, and references as indices of them; -1 for reference 0 where
/// `zero_is_none`.
std::vector<std::int32_t> index_references(const std::vector<std::int32_t>& references, int dim, bool zero_is_none,
                                           const ReferenceNames& known, std::vector<std::string>& names) {
  const std::set<std::int32_t> used(references.begin(), references.end());
  std::map<std::int32_t, std::int32_t> index;
  for (const std::int32_t reference : used) {
    if (reference == 0 && zero_is_none) {
      index[reference] = -1;
      continue;
    }
    const auto found = known.find({dim, reference});
    const std::string name = found != known.end() ? found->second : std::to_string(reference);
    const auto place = std::find(names.begin(), names.end(), name);
    index[reference] = static_cast<std::int32_t>(place - names.begin());
    if (place == names.end()) names.push_back(name);
  }
  std::vector<std::int32_t> result;
  for (const std::int32_t reference : references) result.push_back(index.at(reference));
  return result;
}

void take_points(const MeditMesh& medit, Real length_unit, MeshChunk& chunk) {
  constexpr Real largest_coordinate = 1e50;
  const auto from = static_cast<std::size_t>(medit.dimension);
  for (LocalId node = 0; node < medit.nodes(); ++node) {
    chunk.node_numbers.push_back(node + 1);
    for (std::size_t c = 0; c < static_cast<std::size_t>(chunk.dim); ++c) {
      const Real x = medit.coordinates[static_cast<std::size_t>(node) * from + c];
      if (!(std::isfinite(x) && std::abs(x) <= largest_coordinate)) {
        throw InputError(fmt::format("{}: node {} has the coordinate {}", chunk.source, node + 1, x));
      }
      chunk.coordinates.push_back(x * length_unit);
    }
  }
}

/// What the root read, as its chunk.
void take_medit(const MeditMesh& medit, const ReferenceNames& names, Real length_unit, MeshChunk& chunk) {
  const bool is_3d = !medit.tetrahedra.empty();
  chunk.dim = is_3d ? 3 : 2;
  if (!is_3d && (medit.triangles.empty() || medit.dimension == 3)) {
    throw InputError(
        fmt::format("{}: the file has neither tetrahedra nor triangles of a plane (Dimension 2)", chunk.source));
  }
  take_points(medit, length_unit, chunk);
  const auto number = [](LocalId node) { return GlobalId{node} + 1; };
  const auto& elements = is_3d ? medit.tetrahedra : medit.triangles;
  const auto& references = is_3d ? medit.tetrahedron_reference : medit.triangle_reference;
  std::transform(elements.begin(), elements.end(), std::back_inserter(chunk.element_nodes), number);
  const bool unnamed = std::all_of(references.begin(), references.end(), [](std::int32_t r) { return r == 0; });
  if (unnamed) chunk.region_names = {"default"};
  chunk.element_region = unnamed ? std::vector<std::int32_t>(references.size(), 0)
                                 : index_references(references, chunk.dim, false, names, chunk.region_names);
  for (std::size_t e = 0; e < references.size(); ++e) chunk.element_ids.push_back(static_cast<GlobalId>(e));

  const auto& facets = is_3d ? medit.triangles : medit.edges;
  const auto& facet_references = is_3d ? medit.triangle_reference : medit.edge_reference;
  const auto groups = index_references(facet_references, chunk.dim - 1, true, names, chunk.group_names);
  const auto n = static_cast<std::ptrdiff_t>(chunk.dim);
  for (std::size_t f = 0; f < groups.size(); ++f) {
    if (groups[f] < 0) continue;
    const auto first = facets.begin() + static_cast<std::ptrdiff_t>(f) * n;
    std::transform(first, first + n, std::back_inserter(chunk.facet_nodes), number);
    chunk.facet_group.push_back(groups[f]);
  }
}

/// One entity in words of the format: reals, nodes, reference.
class MeditRecords {
 public:
  explicit MeditRecords(bool binary) : binary_(binary) {}
  template <class T>
  void put(T value) {
    if (binary_) {
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    } else {
      fmt::format_to(std::back_inserter(bytes_), "{} ", value);
    }
  }
  void end() {
    if (!binary_) bytes_.back() = '\n';
  }
  const std::string& bytes() const { return bytes_; }

 private:
  bool binary_;
  std::string bytes_;
};

class MeditWriter {
 public:
  MeditWriter(const Communicator& comm, const Mesh& mesh, const std::string& path)
      : mesh_(mesh),
        binary_(std::filesystem::path(path).extension() == ".meshb"),
        file_(comm, path),
        facets_(comm.sum(static_cast<GlobalId>(
            std::count_if(mesh.facet_group.begin(), mesh.facet_group.end(), [](auto g) { return g >= 0; })))) {
    const GlobalId bytes = sections_end();
    is_long_ = bytes > std::numeric_limits<std::int32_t>::max();
  }

  void write() {
    write_head();
    MeditRecords nodes(binary_);
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      for (int c = 0; c < mesh_.dim; ++c) nodes.put(mesh_.point(node)[c]);
      nodes.put(std::int32_t{0});
      nodes.end();
    }
    write_section("Vertices", 4, mesh_.total_nodes(), node_bytes(), nodes);
    const bool is_3d = mesh_.dim == 3;
    MeditRecords elements(binary_);
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      put_entity(mesh_.nodes_of_element(e), mesh_.element_region[static_cast<std::size_t>(e)], elements);
    }
    write_section(is_3d ? "Tetrahedra" : "Triangles", is_3d ? 8 : 6, mesh_.total_elements, 4 * (mesh_.dim + 2),
                  elements);
    MeditRecords facets(binary_);
    for (LocalId f = 0; f < mesh_.facets(); ++f) {
      const std::int32_t group = mesh_.facet_group[static_cast<std::size_t>(f)];
      if (group >= 0) put_entity(mesh_.nodes_of_facet(f), group, facets);
    }
    write_section(is_3d ? "Triangles" : "Edges", is_3d ? 6 : 5, facets_, 4 * (mesh_.dim + 1), facets);
    write_end();
    file_.close();
  }

 private:
  GlobalId node_bytes() const { return 8 * mesh_.dim + 4; }
  /// Upper bound of the binary file's size.
  GlobalId sections_end() const {
    return 1000 + mesh_.total_nodes() * node_bytes() + (mesh_.total_elements + facets_) * 4 * (mesh_.dim + 2);
  }
  void put_entity(std::span<const LocalId> nodes, std::int32_t index, MeditRecords& out) const {
    for (const LocalId node : nodes) out.put(static_cast<std::int32_t>(mesh_.global_node(node) + 1));
    out.put(index + 1);
    out.end();
  }
  /// Places in the file are of 4 bytes up to version 2, of 8 in version 3.
  void put_place(MeditRecords& out, GlobalId place) const {
    if (is_long_) {
      out.put(place);
    } else {
      out.put(static_cast<std::int32_t>(place));
    }
  }
  void append_head(const MeditRecords& head) {
    file_.append_from_root(head.bytes());
    written_ += static_cast<GlobalId>(head.bytes().size());
  }

  void write_head() {
    if (!binary_) {
      file_.append_from_root(fmt::format("MeshVersionFormatted 2\nDimension {}\n", mesh_.dim));
      return;
    }
    constexpr std::int32_t dimension_code = 3;
    MeditRecords head(true);
    head.put(std::int32_t{1});
    head.put(std::int32_t{is_long_ ? 3 : 2});
    head.put(dimension_code);
    put_place(head, is_long_ ? 24 : 20);
    head.put(std::int32_t{mesh_.dim});
    append_head(head);
  }

  void write_section(const char* name, std::int32_t code, GlobalId count, GlobalId record_bytes,
                     const MeditRecords& mine) {
    if (binary_) {
      MeditRecords head(true);
      head.put(code);
      const GlobalId head_bytes = 4 + (is_long_ ? 8 : 4) + 4;
      put_place(head, written_ + head_bytes + count * record_bytes);
      head.put(static_cast<std::int32_t>(count));
      append_head(head);
      written_ += count * record_bytes;
    } else {
      file_.append_from_root(fmt::format("{}\n{}\n", name, count));
    }
    file_.append(mine.bytes());
  }

  void write_end() {
    constexpr std::int32_t end_code = 54;
    if (!binary_) {
      file_.append_from_root("End\n");
      return;
    }
    MeditRecords end(true);
    end.put(end_code);
    put_place(end, 0);
    append_head(end);
  }

  const Mesh& mesh_;
  bool binary_;
  OrderedFile file_;
  GlobalId facets_;
  bool is_long_ = false;
  GlobalId written_ = 0;
};

}  // namespace

MeshChunk read_medit_mesh(const Communicator& comm, const std::string& path, Real length_unit) {
  MeshChunk chunk;
  chunk.source = path;
  on_root(comm, [&] { take_medit(read_medit(path), read_names(path), length_unit, chunk); });
  share_head(comm, chunk);
  return chunk;
}

void write_medit_mesh(const Communicator& comm, const Mesh& mesh, const std::string& path) {
  if (mesh.total_nodes() > std::numeric_limits<std::int32_t>::max()) {
    throw InputError(fmt::format("{}: the mesh is too large for a Medit file", path));
  }
  MeditWriter(comm, mesh, path).write();
  OrderedFile names(comm, names_path(path));
  const auto write_names = [&](const std::vector<std::string>& list, int dim) {
    for (std::size_t i = 0; i < list.size(); ++i)
      names.append_from_root(fmt::format("{} {} {}\n", dim, i + 1, list[i]));
  };
  write_names(mesh.region_names, mesh.dim);
  write_names(mesh.group_names, mesh.dim - 1);
  names.close();
}

}  // namespace malleus
