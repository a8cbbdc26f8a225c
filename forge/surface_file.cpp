#include "forge/surface_file.hpp"

#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "base/error.hpp"
#include "mesh/msh_reader.hpp"

namespace malleus::forge {
namespace {

constexpr std::size_t stl_header = 84;
constexpr std::size_t stl_facet = 50;
/// Points nearer than this share of the surface's extent are one.
constexpr Real same_place = 1e-9;

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
  return merge_points(loose, same_place * (box.high - box.low).norm());
}

void turn_alike(FacetSet& set) {
  using Ridge = std::array<LocalId, 2>;
  const auto dim = static_cast<std::size_t>(set.dim);
  // Each facet passes a ridge one way: an edge in 3D from corner k to the next, a point in 2D as its start or its end.
  const auto ridge = [&](std::size_t f, std::size_t k) {
    const auto& corners = set.facets[f];
    const LocalId a = corners[k];
    const LocalId b = dim == 2 ? a : corners[(k + 1) % 3];
    const bool forth = dim == 2 ? k == 0 : a < b;
    return std::pair(Ridge{std::min(a, b), std::max(a, b)}, forth);
  };
  std::map<Ridge, std::vector<std::pair<std::size_t, bool>>> at_ridge;
  for (std::size_t f = 0; f < set.facets.size(); ++f) {
    for (std::size_t k = 0; k < dim; ++k) at_ridge[ridge(f, k).first].emplace_back(f, ridge(f, k).second);
  }
  constexpr int unknown = -1;
  std::vector<int> turned(set.facets.size(), unknown);
  for (std::size_t seed = 0; seed < set.facets.size(); ++seed) {
    if (turned[seed] != unknown) continue;
    turned[seed] = 0;
    std::vector<std::size_t> front = {seed};
    while (!front.empty()) {
      const std::size_t f = front.back();
      front.pop_back();
      for (std::size_t k = 0; k < dim; ++k) {
        const auto [key, forth] = ridge(f, k);
        for (const auto& [other, other_forth] : at_ridge[key]) {
          if (turned[other] != unknown) continue;
          turned[other] = (forth == other_forth) != (turned[f] == 1) ? 1 : 0;
          front.push_back(other);
        }
      }
    }
  }
  for (std::size_t f = 0; f < set.facets.size(); ++f) {
    if (turned[f] == 1) std::swap(set.facets[f][0], set.facets[f][1]);
  }
}

namespace {

FacetSet from_gmsh(const std::string& path, int dim, Real length_unit) {
  const MshSurface surface = read_msh_surface(path, dim);
  FacetSet loose;
  loose.dim = dim;
  loose.facets = surface.facets;
  if (loose.facets.empty()) {
    throw InputError(path + (dim == 3 ? ": the file has no triangles, of which a tool's surface is made in 3D"
                                      : ": the file has no lines, of which a tool's surface is made in 2D"));
  }
  std::vector<char> is_used(surface.points.size(), 0);
  for (const auto& facet : loose.facets) {
    for (int k = 0; k < dim; ++k) is_used[static_cast<std::size_t>(facet[static_cast<std::size_t>(k)])] = 1;
  }
  Bounds box;
  for (std::size_t i = 0; i < surface.points.size(); ++i) {
    loose.points.push_back(length_unit * to_vector(surface.points[i].data(), 3));
    if (dim == 2) loose.points.back()[2] = 0;
    if (is_used[i] != 0) box.add(loose.points.back());
  }
  FacetSet set = merge_points(loose, same_place * (box.high - box.low).norm());
  turn_alike(set);
  return set;
}

}  // namespace

FacetSet read_surface_file(const std::string& path, int dim, Real length_unit) {
  if (path.ends_with(".msh")) return from_gmsh(path, dim, length_unit);
  if (dim != 3) throw InputError(path + ": STL surfaces are for 3D cases; give the lines of a gmsh mesh (.msh) in 2D");
  return parse_stl(read_all(path), path, length_unit);
}

}  // namespace malleus::forge
