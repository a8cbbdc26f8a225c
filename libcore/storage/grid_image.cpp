#include "storage/grid_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "parallel/byte_stream.hpp"

namespace malleus {
namespace {

/// For each written component the component of the field that it takes, -1 for zero.
std::vector<int> component_map(int dim, int components) {
  if (components == 1) return {0};
  if (components == dim) return dim == 3 ? std::vector{0, 1, 2} : std::vector{0, 1, -1};
  if (components == dim * (dim + 1) / 2) {
    return dim == 3 ? std::vector{0, 3, 5, 1, 4, 2} : std::vector{0, 2, -1, 1, -1, -1};
  }
  return {};
}

std::string component_name(int component) {
  return fmt::format("_{}", component);
}

void add_attribute(GridImage& image, const Field& field, std::size_t entities) {
  const FieldSpec& spec = field.spec();
  const std::vector<int> map = component_map(image.dim, spec.components);
  const auto source = field.values();
  const auto width = static_cast<std::size_t>(spec.components);
  const auto gather = [&](const std::string& name, const std::vector<int>& columns) {
    GridAttribute attribute{name, spec.support == Support::node, static_cast<int>(columns.size()), {}};
    attribute.values.reserve(entities * columns.size());
    for (std::size_t i = 0; i < entities; ++i) {
      for (const int column : columns) {
        attribute.values.push_back(column < 0 ? 0.0 : source[i * width + static_cast<std::size_t>(column)]);
      }
    }
    image.attributes.push_back(std::move(attribute));
  };
  if (!map.empty()) {
    gather(spec.name, map);
    return;
  }
  for (int c = 0; c < spec.components; ++c) gather(spec.name + component_name(c), {c});
}

std::string data_item(const std::string& dims, const char* type, int bytes, const std::string& path) {
  return fmt::format(R"(<DataItem Dimensions="{}" NumberType="{}" Precision="{}" Format="HDF">{}</DataItem>)", dims,
                     type, bytes, path);
}

}  // namespace

GridImage make_grid_image(int rank, const Mesh& mesh, const std::vector<const Field*>& fields) {
  GridImage image;
  image.rank = rank;
  image.dim = mesh.dim;
  image.points.reserve(static_cast<std::size_t>(mesh.nodes()) * 3);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    for (int c = 0; c < 3; ++c) image.points.push_back(c < mesh.dim ? mesh.point(node)[c] : 0.0);
  }
  image.cells = mesh.element_nodes;
  for (const Field* field : fields) {
    if (field->spec().support == Support::domain) continue;
    add_attribute(image, *field, FieldStore::entities(mesh, field->spec().support));
  }
  image.attributes.push_back({"region", false, 1, {mesh.element_region.begin(), mesh.element_region.end()}});
  image.attributes.push_back(
      {"partition", false, 1, std::vector<double>(static_cast<std::size_t>(mesh.elements()), rank)});
  return image;
}

std::vector<std::byte> pack_grid_image(const GridImage& image) {
  ByteWriter writer;
  writer.put(image.rank);
  writer.put(image.dim);
  writer.put_list<double>(image.points);
  writer.put_list<std::int32_t>(image.cells);
  writer.put(static_cast<std::uint64_t>(image.attributes.size()));
  for (const GridAttribute& attribute : image.attributes) {
    writer.put_list<char>(std::span(attribute.name));
    writer.put(attribute.on_nodes);
    writer.put(attribute.components);
    writer.put_list<double>(attribute.values);
  }
  return writer.take();
}

GridImage unpack_grid_image(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  GridImage image;
  image.rank = reader.get<int>();
  image.dim = reader.get<int>();
  image.points = reader.get_list<double>();
  image.cells = reader.get_list<std::int32_t>();
  image.attributes.resize(reader.get<std::uint64_t>());
  for (GridAttribute& attribute : image.attributes) {
    const auto name = reader.get_list<char>();
    attribute.name.assign(name.begin(), name.end());
    attribute.on_nodes = reader.get<bool>();
    attribute.components = reader.get<int>();
    attribute.values = reader.get_list<double>();
  }
  return image;
}

std::string grid_xml(const GridImage& image, const std::string& file, int float_bytes) {
  const auto path = [&](const std::string& name) { return fmt::format("{}:/p{:04d}/{}", file, image.rank, name); };
  std::string xml = fmt::format("<Grid Name=\"p{:04d}\" GridType=\"Uniform\">\n", image.rank);
  xml += fmt::format("<Topology TopologyType=\"{}\" NumberOfElements=\"{}\">{}</Topology>\n",
                     image.dim == 3 ? "Tetrahedron" : "Triangle", image.cell_count(),
                     data_item(fmt::format("{} {}", image.cell_count(), image.dim + 1), "Int", 4, path("cells")));
  xml += fmt::format("<Geometry GeometryType=\"XYZ\">{}</Geometry>\n",
                     data_item(fmt::format("{} 3", image.point_count()), "Float", float_bytes, path("points")));
  for (const GridAttribute& attribute : image.attributes) {
    const auto count = attribute.on_nodes ? image.point_count() : image.cell_count();
    const char* type = attribute.components == 1 ? "Scalar" : attribute.components == 3 ? "Vector" : "Tensor6";
    const std::string dims =
        attribute.components == 1 ? fmt::format("{}", count) : fmt::format("{} {}", count, attribute.components);
    xml +=
        fmt::format("<Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", attribute.name, type,
                    attribute.on_nodes ? "Node" : "Cell", data_item(dims, "Float", float_bytes, path(attribute.name)));
  }
  return xml + "</Grid>\n";
}

}  // namespace malleus
