#include "mesh/mesh.hpp"

#include <algorithm>

namespace malleus {
namespace {

int index_of(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : static_cast<int>(found - names.begin());
}

}  // namespace

int Mesh::find_region(const std::string& name) const {
  return index_of(region_names, name);
}
int Mesh::find_group(const std::string& name) const {
  return index_of(group_names, name);
}

}  // namespace malleus
