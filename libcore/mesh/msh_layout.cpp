#include "mesh/msh_layout.hpp"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <span>
#include <type_traits>

#include "mesh/msh_scanner.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

template <class T>
void broadcast_list(const Communicator& comm, std::vector<T>& list) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::string bytes(list.size() * sizeof(T), '\0');
  if (!bytes.empty()) std::memcpy(bytes.data(), list.data(), bytes.size());
  comm.broadcast(bytes);
  list.resize(bytes.size() / sizeof(T));
  if (!bytes.empty()) std::memcpy(list.data(), bytes.data(), bytes.size());
}

void broadcast_names(const Communicator& comm, std::map<std::pair<int, int>, std::string>& names) {
  std::vector<std::array<int, 2>> keys;
  for (const auto& [key, name] : names) keys.push_back({key.first, key.second});
  broadcast_list(comm, keys);
  for (const auto& [dim, tag] : keys) comm.broadcast(names[{dim, tag}]);
}

}  // namespace

int msh_node_count(std::int32_t type) {
  switch (type) {
    case msh_type::point:
      return 1;
    case msh_type::line:
      return 2;
    case msh_type::triangle:
      return 3;
    case msh_type::tetrahedron:
      return 4;
    default:
      return 0;
  }
}

std::string msh_type_refusal(std::int32_t type) {
  struct Known {
    std::int32_t type;
    const char* name;
  };
  constexpr std::array shapes = {Known{3, "quadrangle"}, Known{5, "hexahedron"}, Known{6, "prism"},
                                 Known{7, "pyramid"}};
  constexpr std::array second_order = {Known{8, "line"},         Known{9, "triangle"},    Known{10, "quadrangle"},
                                       Known{11, "tetrahedron"}, Known{12, "hexahedron"}, Known{13, "prism"},
                                       Known{14, "pyramid"},     Known{16, "quadrangle"}, Known{17, "hexahedron"},
                                       Known{18, "prism"},       Known{19, "pyramid"}};
  const std::string remedy = "; only triangles and tetrahedra of first order are read";
  for (const Known& shape : shapes) {
    if (shape.type == type) return fmt::format("element type {} is a {}{}", type, shape.name, remedy);
  }
  for (const Known& shape : second_order) {
    if (shape.type != type) continue;
    return fmt::format("element type {} is a {} of second order{} (gmsh: Mesh.ElementOrder = 1)", type, shape.name,
                       remedy);
  }
  return fmt::format("element type {} is not known{}", type, remedy);
}

MshLayout find_msh_layout(const Communicator& comm, const std::string& path) {
  MshLayout layout;
  on_root(comm, [&] { layout = scan_msh(path); });
  layout.binary = comm.broadcast(layout.binary);
  layout.version = comm.broadcast(layout.version == 2) ? 2 : 4;
  broadcast_names(comm, layout.names);
  broadcast_list(comm, layout.nodes);
  broadcast_list(comm, layout.elements);
  broadcast_list(comm, layout.line_index);
  return layout;
}

}  // namespace malleus
