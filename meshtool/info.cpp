#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "mesh/statistics.hpp"
#include "meshtool/commands.hpp"
#include "meshtool/mesh_files.hpp"
#include "meshtool/options.hpp"

namespace malleus::meshtool {
namespace {

nlohmann::json distribution_json(const Distribution& d) {
  return {{"min", d.min}, {"mean", d.mean}, {"max", d.max}, {"p01", d.p01}, {"bins", d.bins}};
}

std::vector<Real> along_axes(const std::array<Real, 3>& corner, int dim) {
  return {corner.begin(), corner.begin() + dim};
}

nlohmann::json to_json(const MeshStatistics& s) {
  nlohmann::json regions = nlohmann::json::array();
  for (const RegionStatistics& region : s.regions) {
    regions.push_back({{"name", region.name}, {"elements", region.elements}, {"volume", region.volume}});
  }
  nlohmann::json groups = nlohmann::json::array();
  for (const GroupStatistics& group : s.groups) {
    groups.push_back({{"name", group.name}, {"facets", group.facets}, {"area", group.area}});
  }
  nlohmann::json edges = distribution_json(s.edges);
  edges["first_bin"] = s.edges.first_edge;
  return {{"dimension", s.dim},
          {"nodes", s.nodes},
          {"elements", s.elements},
          {"boundary_facets", s.exterior_facets},
          {"unnamed_boundary_facets", s.unnamed_exterior_facets},
          {"bounding_box", {{"low", along_axes(s.box.low, s.dim)}, {"high", along_axes(s.box.high, s.dim)}}},
          {"volume", s.volume},
          {"area", s.area},
          {"regions", regions},
          {"groups", groups},
          {"quality", distribution_json(s.quality)},
          {"edges", edges}};
}

std::string point_text(const std::array<Real, 3>& point, int dim) {
  return fmt::format("{:.6g}", fmt::join(along_axes(point, dim), " "));
}

/// A bar of at most 40 signs for a bin.
std::string bar(GlobalId count, const std::vector<GlobalId>& bins) {
  constexpr GlobalId longest = 40;
  const GlobalId largest = *std::max_element(bins.begin(), bins.end());
  return std::string(static_cast<std::size_t>(count == 0 ? 0 : std::max<GlobalId>(1, count * longest / largest)), '#');
}

void print_groups(const MeshStatistics& s) {
  const char* volume_unit = s.dim == 3 ? "m3" : "m2";
  const char* area_unit = s.dim == 3 ? "m2" : "m";
  fmt::print("regions\n");
  for (const RegionStatistics& region : s.regions) {
    fmt::print("  {:<24} {:>12} elements {:>14.6g} {}\n", region.name, region.elements, region.volume, volume_unit);
  }
  fmt::print("boundary groups\n");
  for (const GroupStatistics& group : s.groups) {
    fmt::print("  {:<24} {:>12} facets   {:>14.6g} {}\n", group.name, group.facets, group.area, area_unit);
  }
  if (s.unnamed_exterior_facets > 0) fmt::print("  {:<24} {:>12} facets\n", "(no group)", s.unnamed_exterior_facets);
}

void print_distributions(const MeshStatistics& s) {
  fmt::print("quality (1 regular, 0 flat): min {:.3g}, 1 % {:.3g}, mean {:.3g}, max {:.3g}\n", s.quality.min,
             s.quality.p01, s.quality.mean, s.quality.max);
  for (std::size_t i = 0; i < s.quality.bins.size(); ++i) {
    const GlobalId count = s.quality.bins[i];
    fmt::print("  {:.1f} - {:.1f} {:>12} {}\n", 0.1 * static_cast<Real>(i), 0.1 * static_cast<Real>(i + 1), count,
               bar(count, s.quality.bins));
  }
  fmt::print("edge lengths (m): min {:.4g}, 1 % {:.4g}, mean {:.4g}, max {:.4g}\n", s.edges.min, s.edges.p01,
             s.edges.mean, s.edges.max);
  for (std::size_t i = 0; i < s.edges.bins.size(); ++i) {
    const Real low = std::ldexp(s.edges.first_edge, static_cast<int>(i));
    fmt::print("  from {:<9.3g} {:>12} {}\n", low, s.edges.bins[i], bar(s.edges.bins[i], s.edges.bins));
  }
}

void print_text(const std::string& file, const MeshStatistics& s) {
  fmt::print("{}: {} {}, {} nodes, {} boundary facets\n", file, s.elements, s.dim == 3 ? "tetrahedra" : "triangles",
             s.nodes, s.exterior_facets);
  fmt::print("box from {} to {} m\n", point_text(s.box.low, s.dim), point_text(s.box.high, s.dim));
  fmt::print("volume {:.6g} {}, boundary {:.6g} {}\n", s.volume, s.dim == 3 ? "m3" : "m2", s.area,
             s.dim == 3 ? "m2" : "m");
  print_groups(s);
  print_distributions(s);
}

}  // namespace

int run_info(const Communicator& comm, const std::vector<std::string>& arguments) {
  CLI::App app("Counts, groups, bounding box, volume, quality and edge-length statistics of a mesh.", "meshtool info");
  std::string file;
  bool as_json = false;
  Real length_unit = 1;
  app.add_option("MESH", file, "The mesh: " + mesh_endings())->required();
  app.add_flag("--json", as_json, "Prints JSON instead of text");
  app.add_option("--length-unit", length_unit, "Metres per unit of length in the file (default 1)")
      ->check(CLI::PositiveNumber);
  if (!parse_options(comm, app, arguments)) return exit_code::done;
  FieldStore fields;
  const MeshStatistics statistics = mesh_statistics(comm, read_mesh(comm, file, length_unit, fields));
  if (!comm.is_root()) return exit_code::done;
  if (as_json) {
    fmt::print("{}\n", to_json(statistics).dump(2));
  } else {
    print_text(file, statistics);
  }
  return exit_code::done;
}

}  // namespace malleus::meshtool
