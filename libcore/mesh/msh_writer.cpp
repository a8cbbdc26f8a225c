#include "mesh/msh_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>

#include "base/error.hpp"
#include "mesh/msh_layout.hpp"
#include "mesh/ordered_file.hpp"
#include "mesh/space_filling_curve.hpp"

namespace malleus {
namespace {

/// Numbers as text, a record a line, or as bytes.
class Records {
 public:
  explicit Records(bool binary) : binary_(binary) {}

  template <class T>
  Records& put(T value) {
    if (binary_) {
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    } else {
      if (!is_first_) bytes_ += ' ';
      fmt::format_to(std::back_inserter(bytes_), "{}", value);
      is_first_ = false;
    }
    return *this;
  }
  void end() {
    if (!binary_) bytes_ += '\n';
    is_first_ = true;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  bool binary_;
  bool is_first_ = true;
  std::string bytes_;
};

/// Elements or named facets in one view: what one kind of entity writes.
struct Kind {
  int dim;            ///< of the entity
  std::int32_t type;  ///< of MSH
  const std::vector<std::string>* names;
  const std::vector<LocalId>* nodes;  ///< [entity][dim+1]
  const std::vector<std::int32_t>* group;
  GlobalId total = 0;
  GlobalId first_number = 1;  ///< of this rank's first
};

std::int32_t simplex_type(int dim) {
  constexpr std::array types = {msh_type::point, msh_type::line, msh_type::triangle, msh_type::tetrahedron};
  return types[static_cast<std::size_t>(dim)];
}

class MshWriter {
 public:
  MshWriter(const Communicator& comm, const Mesh& mesh, const std::string& path, MshFormat format)
      : comm_(comm),
        mesh_(mesh),
        format_(format),
        box_(bounding_box(comm, mesh.coordinates, mesh.dim)),
        file_(comm, path) {
    kinds_ = {Kind{mesh.dim - 1, simplex_type(mesh.dim - 1), &mesh.group_names, &mesh.facet_nodes, &mesh.facet_group},
              Kind{mesh.dim, simplex_type(mesh.dim), &mesh.region_names, &mesh.element_nodes, &mesh.element_region}};
    GlobalId first = 1;
    for (Kind& kind : kinds_) {
      const GlobalId mine = std::count_if(kind.group->begin(), kind.group->end(), [](auto g) { return g >= 0; });
      kind.total = comm.sum(mine);
      kind.first_number = first + comm.sum_of_lower_ranks(mine);
      first += kind.total;
    }
  }

  void write() {
    write_head();
    if (format_.version == 2) {
      write_nodes2();
      write_elements2();
    } else {
      write_entities();
      write_nodes4();
      write_elements4();
    }
    file_.close();
  }

 private:
  Records records() const { return Records(format_.binary); }
  void line(const std::string& text) { file_.append_from_root(text + "\n"); }
  /// Binary data end with a line end of their own.
  void end_section(const std::string& name) { line((format_.binary ? "\n$End" : "$End") + name); }
  void header(const Records& values) { file_.append_from_root(values.bytes()); }
  std::array<Real, 3> point(LocalId node) const {
    std::array<Real, 3> result = {0, 0, 0};
    std::copy_n(mesh_.point(node), mesh_.dim, result.begin());
    return result;
  }

  void write_head() {
    line("$MeshFormat");
    line(fmt::format("{} {} 8", format_.version == 2 ? "2.2" : "4.1", format_.binary ? 1 : 0));
    if (format_.binary) {
      header(records().put(std::int32_t{1}));
      line("");
    }
    line("$EndMeshFormat");
    line("$PhysicalNames");
    line(std::to_string(mesh_.group_names.size() + mesh_.region_names.size()));
    for (const Kind& kind : kinds_) {
      for (std::size_t i = 0; i < kind.names->size(); ++i) {
        line(fmt::format("{} {} \"{}\"", kind.dim, i + 1, (*kind.names)[i]));
      }
    }
    line("$EndPhysicalNames");
  }

  void write_nodes2() {
    line("$Nodes");
    line(std::to_string(mesh_.total_nodes()));
    Records nodes = records();
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      nodes.put(static_cast<std::int32_t>(mesh_.global_node(node) + 1));
      for (const Real x : point(node)) nodes.put(x);
      nodes.end();
    }
    file_.append(nodes.bytes());
    end_section("Nodes");
  }

  void write_elements2() {
    line("$Elements");
    line(std::to_string(kinds_[0].total + kinds_[1].total));
    for (const Kind& kind : kinds_) {
      if (kind.total == 0) continue;
      if (format_.binary) {
        header(records().put(kind.type).put(static_cast<std::int32_t>(kind.total)).put(std::int32_t{2}));
      }
      Records elements = records();
      GlobalId number = kind.first_number;
      for (std::size_t e = 0; e < kind.group->size(); ++e) {
        const std::int32_t group = (*kind.group)[e];
        if (group < 0) continue;
        elements.put(static_cast<std::int32_t>(number++));
        if (!format_.binary) elements.put(kind.type).put(2);
        elements.put(group + 1).put(group + 1);
        put_nodes<std::int32_t>(kind, e, elements);
      }
      file_.append(elements.bytes());
    }
    end_section("Elements");
  }

  template <class Number>
  void put_nodes(const Kind& kind, std::size_t entity, Records& out) const {
    const auto n = static_cast<std::size_t>(kind.dim) + 1;
    for (std::size_t i = 0; i < n; ++i) {
      out.put(static_cast<Number>(mesh_.global_node((*kind.nodes)[entity * n + i]) + 1));
    }
    out.end();
  }

  /// One entity for each region and each group, with the box of the whole mesh.
  void write_entities() {
    Records entities = records();
    for (int dim = 0; dim < 4; ++dim) {
      const auto kind = std::find_if(kinds_.begin(), kinds_.end(), [&](const Kind& k) { return k.dim == dim; });
      entities.put(kind == kinds_.end() ? std::uint64_t{0} : std::uint64_t{kind->names->size()});
    }
    entities.end();
    for (const Kind& kind : kinds_) {
      for (std::size_t i = 0; i < kind.names->size(); ++i) {
        const auto tag = static_cast<std::int32_t>(i + 1);
        entities.put(tag);
        for (const auto* corner : {&box_.low, &box_.high}) {
          for (std::size_t c = 0; c < 3; ++c)
            entities.put(c < static_cast<std::size_t>(mesh_.dim) ? (*corner)[c] : 0.0);
        }
        entities.put(std::uint64_t{1}).put(tag).put(std::uint64_t{0}).end();
      }
    }
    line("$Entities");
    header(entities);
    end_section("Entities");
  }

  /// All nodes in one block, on the first region.
  void write_nodes4() {
    const auto total = static_cast<std::uint64_t>(mesh_.total_nodes());
    Records head = records();
    head.put(std::uint64_t{1}).put(total).put(std::uint64_t{1}).put(total).end();
    head.put(mesh_.dim).put(std::int32_t{1}).put(std::int32_t{0}).put(total).end();
    line("$Nodes");
    header(head);
    Records numbers = records();
    Records points = records();
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      numbers.put(static_cast<std::uint64_t>(mesh_.global_node(node) + 1)).end();
      for (const Real x : point(node)) points.put(x);
      points.end();
    }
    file_.append(numbers.bytes());
    file_.append(points.bytes());
    end_section("Nodes");
  }

  /// A block for each group and region that has elements, in the order of their names.
  void write_elements4() {
    std::vector<std::vector<GlobalId>> counts;
    std::uint64_t blocks = 0;
    for (const Kind& kind : kinds_) {
      std::vector<GlobalId>& of_kind = counts.emplace_back(kind.names->size(), 0);
      for (const std::int32_t group : *kind.group) {
        if (group >= 0) ++of_kind[static_cast<std::size_t>(group)];
      }
      if (!of_kind.empty()) comm_.sum_in_place(std::span(of_kind));
      blocks += static_cast<std::uint64_t>(std::count_if(of_kind.begin(), of_kind.end(), [](auto n) { return n > 0; }));
    }
    const auto total = static_cast<std::uint64_t>(kinds_[0].total + kinds_[1].total);
    Records head = records();
    head.put(blocks).put(total).put(std::uint64_t{1}).put(total).end();
    line("$Elements");
    header(head);
    GlobalId first = 1;
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
      for (std::size_t group = 0; group < counts[k].size(); ++group) {
        if (counts[k][group] == 0) continue;
        write_block4(kinds_[k], static_cast<std::int32_t>(group), counts[k][group], first);
        first += counts[k][group];
      }
    }
    end_section("Elements");
  }

  void write_block4(const Kind& kind, std::int32_t group, GlobalId total, GlobalId first) {
    Records head = records();
    head.put(kind.dim).put(group + 1).put(kind.type).put(static_cast<std::uint64_t>(total)).end();
    header(head);
    GlobalId number = first + comm_.sum_of_lower_ranks(std::count(kind.group->begin(), kind.group->end(), group));
    Records elements = records();
    for (std::size_t e = 0; e < kind.group->size(); ++e) {
      if ((*kind.group)[e] != group) continue;
      elements.put(static_cast<std::uint64_t>(number++));
      put_nodes<std::uint64_t>(kind, e, elements);
    }
    file_.append(elements.bytes());
  }

  const Communicator& comm_;
  const Mesh& mesh_;
  MshFormat format_;
  Box box_;
  OrderedFile file_;
  std::vector<Kind> kinds_;  ///< facets, elements
};

}  // namespace

void write_msh(const Communicator& comm, const Mesh& mesh, const std::string& path, MshFormat format) {
  check(format.version == 2 || format.version == 4, "MSH 2.2 or 4.1");
  const GlobalId facets = comm.sum(static_cast<GlobalId>(mesh.facets()));
  const GlobalId largest = std::max(mesh.total_nodes(), mesh.total_elements + facets);
  if (format.version == 2 && largest > std::numeric_limits<std::int32_t>::max()) {
    throw InputError(fmt::format("{}: the mesh is too large for MSH 2.2: write MSH 4.1", path));
  }
  MshWriter(comm, mesh, path, format).write();
}

}  // namespace malleus
