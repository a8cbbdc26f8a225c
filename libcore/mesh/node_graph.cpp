#include "mesh/node_graph.hpp"

#include <algorithm>

namespace malleus {
namespace {

/// Elements at each node: [start[n], start[n+1]) of `elements`.
struct NodeElements {
  std::vector<std::int64_t> start;
  std::vector<LocalId> elements;
};

NodeElements elements_at_nodes(const Mesh& mesh) {
  NodeElements result;
  result.start.assign(static_cast<std::size_t>(mesh.nodes()) + 1, 0);
  for (const LocalId node : mesh.element_nodes) ++result.start[static_cast<std::size_t>(node) + 1];
  for (std::size_t n = 1; n < result.start.size(); ++n) result.start[n] += result.start[n - 1];
  result.elements.resize(mesh.element_nodes.size());
  std::vector<std::int64_t> next(result.start.begin(), result.start.end() - 1);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e)) {
      result.elements[static_cast<std::size_t>(next[static_cast<std::size_t>(node)]++)] = e;
    }
  }
  return result;
}

}  // namespace

NodeGraph build_node_graph(const Mesh& mesh) {
  const NodeElements at = elements_at_nodes(mesh);
  NodeGraph graph;
  graph.start.assign(1, 0);
  graph.start.reserve(static_cast<std::size_t>(mesh.nodes()) + 1);
  std::vector<LocalId> row;
  for (std::size_t n = 0; n < static_cast<std::size_t>(mesh.nodes()); ++n) {
    row.clear();
    for (std::int64_t k = at.start[n]; k < at.start[n + 1]; ++k) {
      const auto nodes = mesh.nodes_of_element(at.elements[static_cast<std::size_t>(k)]);
      row.insert(row.end(), nodes.begin(), nodes.end());
    }
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    graph.neighbours.insert(graph.neighbours.end(), row.begin(), row.end());
    graph.start.push_back(static_cast<std::int64_t>(graph.neighbours.size()));
  }
  return graph;
}

}  // namespace malleus
