#include "support/msh_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>

#include "support/world.hpp"

namespace malleus::test {
namespace {

using Cell = std::array<int, 3>;

class BoxFile {
 public:
  BoxFile(int dim, int n) : dim_(dim), n_(n) {
    mesh_.names = {{{dim, 7}, "left part"},
                   {{dim, 3}, "right"},
                   {{dim - 1, 1}, "bottom"},
                   {{dim - 1, 2}, "top"},
                   {{dim - 1, 40}, "unused"}};
  }

  MshMesh build() {
    add_nodes();
    mesh_.elements.push_back({next_++, 15, 77, {tag_of({0, 0, 0})}});
    for_each_simplex([&](const std::vector<Cell>& corners) { add_sides(corners); });
    for_each_simplex([&](const std::vector<Cell>& corners) { add_element(corners); });
    return std::move(mesh_);
  }

 private:
  GlobalId tag_of(const Cell& c) const {
    const GlobalId i = c[0] + (n_ + 1) * (c[1] + (n_ + 1) * c[2]);
    return 5 + i * 3 + i / 11 * 100000;
  }

  void add_nodes() {
    const int layers = dim_ == 3 ? n_ : 0;
    for (int k = 0; k <= layers; ++k) {
      for (int j = 0; j <= n_; ++j) {
        for (int i = 0; i <= n_; ++i) {
          const Real h = 1.0 / n_;
          mesh_.nodes.push_back({tag_of({i, j, k}), {i * h, 2 * j * h, 3 * k * h}});
        }
      }
    }
    std::rotate(mesh_.nodes.begin(), mesh_.nodes.begin() + 4, mesh_.nodes.end());
  }

  template <class Visit>
  void for_each_simplex(Visit visit) {
    const int layers = dim_ == 3 ? n_ : 1;
    for (int k = 0; k < layers; ++k) {
      for (int j = 0; j < n_; ++j) {
        for (int i = 0; i < n_; ++i) {
          std::array<std::size_t, 3> axes = {0, 1, 2};
          do {
            if (dim_ == 2 && axes[2] != 2) continue;
            std::vector<Cell> corners = {{i, j, k}};
            for (int step = 0; step < dim_; ++step) {
              corners.push_back(corners.back());
              ++corners.back()[axes[static_cast<std::size_t>(step)]];
            }
            visit(corners);
          } while (std::next_permutation(axes.begin(), axes.end()));
        }
      }
    }
  }

  void add_sides(const std::vector<Cell>& corners) {
    const auto last = static_cast<std::size_t>(dim_ - 1);
    add_side(corners, last, 0, 1);
    add_side(corners, last, n_, 2);
    add_side(corners, 0, 0, 9);
  }

  void add_side(const std::vector<Cell>& corners, std::size_t axis, int plane, int physical) {
    std::vector<GlobalId> nodes;
    for (const Cell& corner : corners) {
      if (corner[axis] == plane) nodes.push_back(tag_of(corner));
    }
    if (static_cast<int>(nodes.size()) == dim_) mesh_.elements.push_back({next_++, dim_ - 1, physical, nodes});
  }

  void add_element(const std::vector<Cell>& corners) {
    std::vector<GlobalId> nodes;
    for (const Cell& corner : corners) nodes.push_back(tag_of(corner));
    if (next_ % 3 == 0) std::swap(nodes[0], nodes[1]);
    mesh_.elements.push_back({next_++, dim_ == 3 ? 4 : 2, 2 * corners.front()[0] < n_ ? 7 : 3, nodes});
  }

  int dim_;
  int n_;
  GlobalId next_ = 1;
  MshMesh mesh_;
};

/// Bytes of numbers, or their text.
class Writer {
 public:
  explicit Writer(bool binary) : binary_(binary) {}
  template <class T>
  void put(T value) {
    if (binary_) {
      text_.append(reinterpret_cast<const char*>(&value), sizeof value);
    } else {
      text_ += fmt::format("{} ", value);
    }
  }
  void end_record() {
    if (!binary_) text_ += "\n";
  }
  void line(const std::string& text) { text_ += text + "\n"; }
  std::string take() { return std::move(text_); }

 private:
  bool binary_;
  std::string text_;
};

int dim_of_type(int type) {
  return type == 15 ? 0 : type == 4 ? 3 : type;
}

void write_head(const MshMesh& mesh, MshFlavour flavour, Writer& out) {
  out.line("$MeshFormat");
  out.line(fmt::format("{} {} 8", flavour.version == 2 ? "2.2" : "4.1", flavour.binary ? 1 : 0));
  if (flavour.binary) {
    out.put(std::int32_t{1});
    out.line("");
  }
  out.line("$EndMeshFormat");
  if (mesh.names.empty()) return;
  out.line("$PhysicalNames");
  out.line(std::to_string(mesh.names.size()));
  for (const auto& [key, name] : mesh.names) out.line(fmt::format("{} {} \"{}\"", key.first, key.second, name));
  out.line("$EndPhysicalNames");
}

void write_body2(const MshMesh& mesh, bool binary, Writer& out) {
  out.line("$Nodes");
  out.line(std::to_string(mesh.nodes.size()));
  for (const MshNode& node : mesh.nodes) {
    out.put(static_cast<std::int32_t>(node.tag));
    for (const Real x : node.point) out.put(x);
    out.end_record();
  }
  if (binary) out.line("");
  out.line("$EndNodes");
  out.line("$Elements");
  out.line(std::to_string(mesh.elements.size()));
  for (const MshElement& element : mesh.elements) {
    const auto int32 = [&](GlobalId value) { out.put(static_cast<std::int32_t>(value)); };
    if (binary) {
      int32(element.type);
      int32(1);
      int32(2);
    }
    int32(element.tag);
    if (!binary) {
      int32(element.type);
      int32(2);
    }
    int32(element.physical);
    int32(1);
    for (const GlobalId node : element.nodes) int32(node);
    out.end_record();
  }
  if (binary) out.line("");
  out.line("$EndElements");
}

/// Entities: one for each dimension and physical tag, tagged by its place.
using Entities = std::map<std::pair<int, int>, std::vector<const MshElement*>>;

void write_entities(const Entities& entities, Writer& out) {
  std::array<std::uint64_t, 4> counts = {0, 0, 0, 0};
  for (const auto& [key, list] : entities) ++counts[static_cast<std::size_t>(key.first)];
  out.line("$Entities");
  for (const std::uint64_t count : counts) out.put(count);
  out.end_record();
  for (const auto& [key, list] : entities) {
    out.put(std::int32_t{key.second + 1000});
    for (int k = 0; k < (key.first == 0 ? 3 : 6); ++k) out.put(0.0);
    out.put(std::uint64_t{key.second != 0});
    if (key.second != 0) out.put(std::int32_t{key.second});
    if (key.first > 0) out.put(std::uint64_t{0});
    out.end_record();
  }
  out.line("$EndEntities");
}

void write_nodes4(const MshMesh& mesh, Writer& out) {
  const std::size_t half = mesh.nodes.size() / 2;
  out.line("$Nodes");
  for (const std::uint64_t value :
       {std::uint64_t{2}, std::uint64_t{mesh.nodes.size()}, std::uint64_t{1}, std::uint64_t{99999999}}) {
    out.put(value);
  }
  out.end_record();
  for (const auto& [begin, end] : {std::pair(std::size_t{0}, half), std::pair(half, mesh.nodes.size())}) {
    // The second block is parametric, on a surface: two values more behind each point.
    const bool parametric = begin > 0;
    out.put(std::int32_t{2});
    out.put(std::int32_t{1});
    out.put(std::int32_t{parametric});
    out.put(std::uint64_t{end - begin});
    out.end_record();
    for (std::size_t i = begin; i < end; ++i) {
      out.put(static_cast<std::uint64_t>(mesh.nodes[i].tag));
      out.end_record();
    }
    for (std::size_t i = begin; i < end; ++i) {
      for (const Real x : mesh.nodes[i].point) out.put(x);
      if (parametric) {
        out.put(0.5);
        out.put(0.25);
      }
      out.end_record();
    }
  }
  out.line("$EndNodes");
}

void write_body4(const MshMesh& mesh, Writer& out) {
  Entities entities;
  for (const MshElement& element : mesh.elements) {
    entities[{dim_of_type(element.type), element.physical}].push_back(&element);
  }
  write_entities(entities, out);
  write_nodes4(mesh, out);
  out.line("$Elements");
  for (const std::uint64_t value : {entities.size(), mesh.elements.size(), std::size_t{1}, mesh.elements.size()}) {
    out.put(value);
  }
  out.end_record();
  for (const auto& [key, list] : entities) {
    out.put(std::int32_t{key.first});
    out.put(std::int32_t{key.second + 1000});
    out.put(std::int32_t{list.front()->type});
    out.put(std::uint64_t{list.size()});
    out.end_record();
    for (const MshElement* element : list) {
      out.put(static_cast<std::uint64_t>(element->tag));
      for (const GlobalId node : element->nodes) out.put(static_cast<std::uint64_t>(node));
      out.end_record();
    }
  }
  out.line("$EndElements");
}

}  // namespace

MshMesh box_msh(int dim, int n) {
  return BoxFile(dim, n).build();
}

std::string msh_bytes(const MshMesh& mesh, MshFlavour flavour) {
  Writer out(flavour.binary);
  write_head(mesh, flavour, out);
  if (flavour.version == 2) {
    write_body2(mesh, flavour.binary, out);
  } else {
    write_body4(mesh, out);
  }
  return out.take();
}

std::string put_file(const ScratchDirectory& scratch, const std::string& name, const std::string& bytes) {
  const std::string path = (scratch.path() / name).string();
  if (world().is_root()) {
    std::ofstream out(path, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  world().barrier();
  return path;
}

}  // namespace malleus::test
