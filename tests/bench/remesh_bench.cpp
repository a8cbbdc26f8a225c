/// Runs the remesher alone on a Medit mesh and prints its report as JSON: the counterpart of a serial remesher's
/// command line in comparisons.
///
/// remesh_bench IN.meshb OUT.meshb (--size H | --metric FILE.solb) [--keep-volume] [--hausdorff H] [--gradation B]

#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "mesh/medit_io.hpp"
#include "remesh/remesh.hpp"

namespace {

using namespace malleus;

RemeshMesh from_medit(const MeditMesh& medit) {
  RemeshMesh mesh;
  mesh.dimension = medit.dimension;
  mesh.coordinates = medit.coordinates;
  const bool solid = medit.dimension == 3;
  mesh.element_nodes = solid ? medit.tetrahedra : medit.triangles;
  mesh.element_region = solid ? medit.tetrahedron_reference : medit.triangle_reference;
  mesh.facet_nodes = solid ? medit.triangles : medit.edges;
  mesh.facet_group = solid ? medit.triangle_reference : medit.edge_reference;
  mesh.corners = medit.corners;
  return mesh;
}

MeditMesh to_medit(const RemeshMesh& mesh) {
  MeditMesh medit;
  medit.dimension = mesh.dimension;
  medit.coordinates = mesh.coordinates;
  const bool solid = mesh.dimension == 3;
  (solid ? medit.tetrahedra : medit.triangles) = mesh.element_nodes;
  (solid ? medit.tetrahedron_reference : medit.triangle_reference) = mesh.element_region;
  (solid ? medit.triangles : medit.edges) = mesh.facet_nodes;
  (solid ? medit.triangle_reference : medit.edge_reference) = mesh.facet_group;
  medit.corners = mesh.corners;
  if (solid) {
    medit.edges = mesh.curve_nodes;
    medit.edge_reference = mesh.curve_group;
    for (LocalId e = 0; e < mesh.curves(); ++e) medit.ridges.push_back(e);
  }
  return medit;
}

Metric read_metric(const std::string& file) {
  MeditSolution solution = read_medit_solution(file);
  if (solution.components == 1) return Metric::per_node(std::move(solution.values));
  return Metric::tensors(solution.dimension, std::move(solution.values));
}

nlohmann::ordered_json to_json(const RemeshQuality& quality) {
  return {{"min", quality.minimum},
          {"mean", quality.mean},
          {"conforming", quality.conforming},
          {"inverted", quality.inverted}};
}

nlohmann::ordered_json to_json(const RemeshReport& report) {
  nlohmann::ordered_json json = {{"nodes", {report.nodes_before, report.nodes_after}},
                                 {"elements", {report.elements_before, report.elements_after}},
                                 {"volume", {report.volume_before, report.volume_after}},
                                 {"before", to_json(report.before)},
                                 {"after", to_json(report.after)},
                                 {"splits", report.splits},
                                 {"collapses", report.collapses},
                                 {"swaps", report.swaps},
                                 {"moves", report.moves}};
  Real total = 0;
  for (const auto& phase : report.phases) {
    json["seconds"][phase.name] = phase.processor_s;
    total += phase.processor_s;
  }
  json["seconds"]["all"] = total;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  json["user_seconds"] = static_cast<Real>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<Real>(usage.ru_utime.tv_usec);
  json["peak_mib"] = usage.ru_maxrss / 1024;
  return json;
}

int run(int argc, char** argv) {
  CLI::App app("remeshes a Medit file and reports");
  std::string input;
  std::string output;
  std::string metric_file;
  Real size = 0;
  RemeshOptions options;
  app.add_option("input", input)->required();
  app.add_option("output", output)->required();
  app.add_option("--size", size);
  app.add_option("--metric", metric_file);
  app.add_option("--rounds", options.improvement_rounds);
  app.add_option("--hausdorff", options.hausdorff);
  app.add_option("--surface-finer", options.surface_finer);
  app.add_flag("--keep-volume", options.keep_volume);
  app.add_flag("--keep-surface", options.keep_surface);
  CLI11_PARSE(app, argc, argv);
  RemeshMesh mesh = from_medit(read_medit(input));
  const Metric metric = metric_file.empty() ? Metric::uniform(size) : read_metric(metric_file);
  const RemeshReport report = remesh(mesh, metric, options);
  write_medit(output, to_medit(mesh));
  std::cout << to_json(report).dump() << '\n';
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const Error& error) {
    std::cerr << "error: " << error.what() << '\n';
    return error.code();
  }
}
