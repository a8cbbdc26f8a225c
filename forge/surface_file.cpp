#include "forge/surface_file.hpp"

#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "base/error.hpp"

namespace malleus::forge {
namespace {

constexpr std::size_t stl_header = 84;
constexpr std::size_t stl_facet = 50;

std::string read_all(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError("cannot read the tool's surface " + path);
  std::ostringstream content;
  content << file.rdbuf();
  return content.str();
}

void add_facet(FacetSet& set, const std::array<Vector, 3>& corners) {
  const auto first = static_cast<LocalId>(set.points.size());
  set.points.insert(set.points.end(), corners.begin(), corners.end());
  set.facets.push_back({first, first + 1, first + 2});
}

bool is_binary_stl(const std::string& content) {
  if (content.size() < stl_header) return false;
  std::uint32_t facets = 0;
  std::memcpy(&facets, content.data() + 80, sizeof facets);
  return content.size() == stl_header + stl_facet * static_cast<std::size_t>(facets);
}

FacetSet parse_binary_stl(const std::string& content) {
  FacetSet set;
  for (std::size_t at = stl_header; at < content.size(); at += stl_facet) {
    std::array<float, 9> values{};
    std::memcpy(values.data(), content.data() + at + 12, sizeof values);
    std::array<Vector, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = Vector(values[3 * k], values[3 * k + 1], values[3 * k + 2]);
    add_facet(set, corners);
  }
  return set;
}

FacetSet parse_ascii_stl(const std::string& content, const std::string& name) {
  FacetSet set;
  std::istringstream lines(content);
  std::array<Vector, 3> corners;
  std::size_t corner = 0;
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "vertex") {
      Vector point;
      if (!(words >> point[0] >> point[1] >> point[2]) || corner == 3) {
        throw InputError(name + ":" + std::to_string(number) +
                         ": 'vertex x y z' expected, three a facet; found: " + line);
      }
      corners[corner++] = point;
    } else if (word == "endfacet") {
      if (corner != 3) throw InputError(name + ":" + std::to_string(number) + ": a facet has three vertices");
      add_facet(set, corners);
      corner = 0;
    }
  }
  if (corner != 0) throw InputError(name + ": the file ends within a facet");
  return set;
}

}  // namespace

FacetSet merge_points(const FacetSet& loose, Real tolerance) {
  using Cell = std::array<std::int64_t, 3>;
  const Real pitch = std::max(tolerance, 1e-300);
  Vector low = Vector::Zero();
  Bounds box;
  for (const Vector& point : loose.points) box.add(point);
  if (!box.empty()) low = box.low;
  FacetSet merged;
  merged.dim = loose.dim;
  std::map<Cell, LocalId> grid;
  std::vector<LocalId> new_point;
  for (const Vector& point : loose.points) {
    Cell cell{};
    for (std::size_t i = 0; i < 3; ++i) {
      cell[i] = std::llround((point[static_cast<Eigen::Index>(i)] - low[static_cast<Eigen::Index>(i)]) / pitch);
    }
    LocalId match = -1;
    for (int shift = 0; shift < 27 && match < 0; ++shift) {
      const Cell around = {cell[0] + shift % 3 - 1, cell[1] + shift / 3 % 3 - 1, cell[2] + shift / 9 - 1};
      const auto found = grid.find(around);
      if (found == grid.end()) continue;
      if ((merged.points[static_cast<std::size_t>(found->second)] - point).norm() <= tolerance) match = found->second;
    }
    if (match < 0) {
      match = static_cast<LocalId>(merged.points.size());
      merged.points.push_back(point);
      grid.emplace(cell, match);
    }
    new_point.push_back(match);
  }
  for (const auto& facet : loose.facets) {
    std::array<LocalId, 3> corners = {-1, -1, -1};
    bool is_whole = true;
    for (std::size_t k = 0; k < static_cast<std::size_t>(loose.dim); ++k) {
      corners[k] = new_point[static_cast<std::size_t>(facet[k])];
      for (std::size_t j = 0; j < k; ++j) is_whole = is_whole && corners[j] != corners[k];
    }
    if (is_whole) merged.facets.push_back(corners);
  }
  return merged;
}

FacetSet parse_stl(const std::string& content, const std::string& name, Real length_unit) {
  FacetSet loose = is_binary_stl(content) ? parse_binary_stl(content) : parse_ascii_stl(content, name);
  if (loose.facets.empty()) throw InputError(name + ": no facets found; STL, ASCII or binary, is expected");
  Bounds box;
  for (Vector& point : loose.points) {
    if (!point.allFinite()) throw InputError(name + ": a coordinate is not a number");
    point *= length_unit;
    box.add(point);
  }
  return merge_points(loose, 1e-9 * (box.high - box.low).norm());
}

FacetSet read_surface_file(const std::string& path, int dim, Real length_unit) {
  if (dim != 3) throw InputError(path + ": STL surfaces are for 3D cases; give the lines of a gmsh mesh in 2D");
  return parse_stl(read_all(path), path, length_unit);
}

}  // namespace malleus::forge
