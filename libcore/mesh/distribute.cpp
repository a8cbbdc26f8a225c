#include "mesh/distribute.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>

#include "base/error.hpp"
#include "mesh/curve_partition.hpp"
#include "mesh/facet_routing.hpp"
#include "mesh/node_directory.hpp"
#include "mesh/number_table.hpp"
#include "mesh/simplex.hpp"
#include "mesh/space_filling_curve.hpp"
#include "parallel/agreement.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

void check_chunk(const MeshChunk& chunk) {
  const std::size_t elements = chunk.element_region.size();
  const auto n = static_cast<std::size_t>(chunk.dim);
  check(chunk.dim == 2 || chunk.dim == 3, "a mesh has 2 or 3 dimensions");
  check(chunk.coordinates.size() == chunk.node_numbers.size() * n, "a node has dim coordinates");
  check(chunk.element_nodes.size() == elements * (n + 1), "an element has dim+1 nodes");
  check(chunk.element_ids.size() == elements, "an element has an id");
  check(chunk.element_weights.empty() || chunk.element_weights.size() == elements, "an element has a weight or none");
  check(chunk.facet_nodes.size() == chunk.facet_group.size() * n, "a facet has dim nodes");
}

/// The elements that this rank read, their nodes numbered here and with coordinates.
struct ReadElements {
  int dim = 3;
  std::vector<GlobalId> numbers;  ///< of the nodes, in the order of first use
  std::vector<Real> coordinates;  ///< [node][dim]
  std::vector<LocalId> nodes;     ///< [element][dim+1], indices in numbers

  std::span<const LocalId> nodes_of(std::size_t element) const {
    const auto n = static_cast<std::size_t>(dim) + 1;
    return std::span(nodes).subspan(element * n, n);
  }
  const Real* point(LocalId node) const { return coordinates.data() + static_cast<std::size_t>(node) * dim; }
};

void refuse_repeated_nodes(const MeshChunk& chunk) {
  const auto n = static_cast<std::size_t>(chunk.dim) + 1;
  for (std::size_t slot = 0; slot < chunk.element_nodes.size(); ++slot) {
    for (std::size_t other = slot / n * n; other < slot; ++other) {
      if (chunk.element_nodes[slot] != chunk.element_nodes[other]) continue;
      throw InputError(fmt::format("{}: an element has the node {} twice", chunk.source, chunk.element_nodes[slot]));
    }
  }
}

/// Numbers the nodes of the chunk's elements and fetches their coordinates; the chunk's lists are emptied on the way.
ReadElements number_elements(const Communicator& comm, MeshChunk& chunk, DistributionReport& report) {
  agree(comm, [&] { refuse_repeated_nodes(chunk); });
  NodeDirectory directory(comm, chunk.source, chunk.dim, chunk.node_numbers, chunk.coordinates);
  chunk.node_numbers = {};
  chunk.coordinates = {};
  ReadElements read;
  read.dim = chunk.dim;
  NumberTable table(chunk.element_region.size() / 4);
  read.nodes.reserve(chunk.element_nodes.size());
  for (const GlobalId number : chunk.element_nodes) read.nodes.push_back(table.insert(number));
  chunk.element_nodes = {};
  read.numbers = std::move(table).take_numbers();
  read.coordinates = directory.fetch(comm, read.numbers);
  report.repeated_nodes = comm.sum(directory.repeated());
  report.unused_nodes = comm.sum(directory.never_fetched());
  return read;
}

/// Nodes of an element in the order of their numbers.
std::array<LocalId, 4> by_number(const ReadElements& read, std::size_t element) {
  const auto nodes = read.nodes_of(element);
  std::array<LocalId, 4> sorted = {-1, -1, -1, -1};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    std::size_t place = i;
    const GlobalId number = read.numbers[static_cast<std::size_t>(nodes[i])];
    for (; place > 0 && read.numbers[static_cast<std::size_t>(sorted[place - 1])] > number; --place) {
      sorted[place] = sorted[place - 1];
    }
    sorted[place] = nodes[i];
  }
  return sorted;
}

/// Place of each element's centroid on the curve. The nodes are summed in the order of their numbers, so that elements
/// of the same nodes have the same key.
std::vector<std::uint64_t> curve_keys(const Communicator& comm, const ReadElements& read) {
  const Box box = bounding_box(comm, read.coordinates, read.dim);
  const auto n = static_cast<std::size_t>(read.dim) + 1;
  std::vector<std::uint64_t> keys(read.nodes.size() / n);
  for (std::size_t e = 0; e < keys.size(); ++e) {
    const std::array<LocalId, 4> nodes = by_number(read, e);
    std::array<Real, 3> centroid = {0, 0, 0};
    for (std::size_t i = 0; i < n; ++i) {
      for (int c = 0; c < read.dim; ++c) {
        centroid[static_cast<std::size_t>(c)] += read.point(nodes[i])[c] / static_cast<Real>(n);
      }
    }
    keys[e] = hilbert_key(centroid.data(), read.dim, box);
  }
  return keys;
}

GlobalId count_inverted(const ReadElements& read) {
  return with_dim(read.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    GlobalId inverted = 0;
    for (std::size_t e = 0; e < read.nodes.size() / (D + 1); ++e) {
      SimplexPoints<D> points;
      for (int i = 0; i <= D; ++i) {
        points.col(i) = Eigen::Map<const Point<D>>(read.point(read.nodes_of(e)[static_cast<std::size_t>(i)]));
      }
      if (simplex_volume<D>(points) < 0) ++inverted;
    }
    return inverted;
  });
}

/// What travels to the rank of an element.
struct SentElement {
  GlobalId id;
  std::int64_t region;
  std::array<GlobalId, 4> nodes;
};
struct SentNode {
  GlobalId number;
  std::array<Real, 3> point;
};

struct Shipment {
  std::map<int, std::vector<SentElement>> elements;
  std::map<int, std::vector<SentNode>> nodes;
};

/// The elements by destination, each destination's nodes once.
Shipment pack(const MeshChunk& chunk, const ReadElements& read, std::span<const int> destinations) {
  std::vector<std::size_t> order(destinations.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return destinations[a] < destinations[b]; });
  Shipment shipment;
  std::vector<int> sent_to(read.numbers.size(), -1);
  for (const std::size_t e : order) {
    const int rank = destinations[e];
    SentElement element = {chunk.element_ids[e], chunk.element_region[e], {-1, -1, -1, -1}};
    std::vector<SentNode>& nodes = shipment.nodes[rank];
    for (std::size_t i = 0; i < read.nodes_of(e).size(); ++i) {
      const LocalId node = read.nodes_of(e)[i];
      const GlobalId number = read.numbers[static_cast<std::size_t>(node)];
      element.nodes[i] = number;
      int& last_rank = sent_to[static_cast<std::size_t>(node)];
      if (last_rank == rank) continue;
      last_rank = rank;
      SentNode& sent = nodes.emplace_back(SentNode{number, {0, 0, 0}});
      std::copy_n(read.point(node), read.dim, sent.point.begin());
    }
    shipment.elements[rank].push_back(element);
  }
  return shipment;
}

/// Of elements with the same nodes the one with the lowest id is kept. Returns which are repeated.
std::vector<char> find_repeated(const std::vector<SentElement>& elements, const NumberTable& table) {
  std::vector<std::array<GlobalId, 4>> sorted(elements.size());
  std::vector<std::pair<LocalId, std::size_t>> by_lowest(elements.size());
  for (std::size_t e = 0; e < elements.size(); ++e) {
    sorted[e] = elements[e].nodes;
    std::sort(sorted[e].begin(), sorted[e].end());
    const GlobalId lowest = sorted[e][0] < 0 ? sorted[e][1] : sorted[e][0];
    by_lowest[e] = {table.find(lowest), e};
  }
  std::vector<std::size_t> begin(static_cast<std::size_t>(table.size()) + 1, 0);
  for (const auto& [node, e] : by_lowest) ++begin[static_cast<std::size_t>(node) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::size_t> filed(elements.size());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (const auto& [node, e] : by_lowest) filed[next[static_cast<std::size_t>(node)]++] = e;
  std::vector<char> repeated(elements.size(), 0);
  for (std::size_t node = 0; node + 1 < begin.size(); ++node) {
    for (std::size_t i = begin[node]; i < begin[node + 1]; ++i) {
      for (std::size_t j = begin[node]; j < begin[node + 1]; ++j) {
        const bool same = i != j && sorted[filed[i]] == sorted[filed[j]];
        const bool earlier = std::pair(elements[filed[j]].id, filed[j]) < std::pair(elements[filed[i]].id, filed[i]);
        if (same && earlier) repeated[filed[i]] = 1;
      }
    }
  }
  return repeated;
}

/// Received elements and nodes as a piece without facets.
MeshPiece unpack(const MeshChunk& chunk, const Shipment& received, DistributionReport& report) {
  MeshPiece piece;
  piece.dim = chunk.dim;
  piece.region_names = chunk.region_names;
  piece.group_names = chunk.group_names;
  NumberTable table;
  for (const auto& [rank, nodes] : received.nodes) {
    for (const SentNode& node : nodes) {
      const LocalId known = table.size();
      if (table.insert(node.number) != known) continue;
      piece.coordinates.insert(piece.coordinates.end(), node.point.begin(), node.point.begin() + chunk.dim);
    }
  }
  std::vector<SentElement> elements;
  for (const auto& [rank, list] : received.elements) elements.insert(elements.end(), list.begin(), list.end());
  const std::vector<char> repeated = find_repeated(elements, table);
  for (std::size_t e = 0; e < elements.size(); ++e) {
    if (repeated[e] != 0) {
      ++report.repeated_elements;
      continue;
    }
    piece.element_ids.push_back(elements[e].id);
    piece.element_region.push_back(static_cast<std::int32_t>(elements[e].region));
    for (int i = 0; i <= chunk.dim; ++i) {
      piece.element_nodes.push_back(table.find(elements[e].nodes[static_cast<std::size_t>(i)]));
    }
  }
  piece.node_numbers = std::move(table).take_numbers();
  return piece;
}

void broadcast_names(const Communicator& comm, std::vector<std::string>& names) {
  auto count = static_cast<GlobalId>(names.size());
  comm.broadcast(std::span(&count, 1));
  names.resize(static_cast<std::size_t>(count));
  for (std::string& name : names) comm.broadcast(name);
}

}  // namespace

void share_head(const Communicator& comm, MeshChunk& chunk) {
  GlobalId dim = chunk.dim;
  comm.broadcast(std::span(&dim, 1));
  chunk.dim = static_cast<int>(dim);
  broadcast_names(comm, chunk.region_names);
  broadcast_names(comm, chunk.group_names);
}

DistributedPiece distribute_mesh(const Communicator& comm, MeshChunk chunk) {
  check_chunk(chunk);
  DistributedPiece result;
  Shipment shipment;
  {
    const ReadElements read = number_elements(comm, chunk, result.report);
    result.report.inverted_elements = comm.sum(count_inverted(read));
    const std::vector<std::uint64_t> keys = curve_keys(comm, read);
    shipment = pack(chunk, read, curve_partition(comm, keys, chunk.element_weights));
  }
  Shipment received;
  received.nodes = sparse_exchange(comm, shipment.nodes);
  shipment.nodes.clear();
  received.elements = sparse_exchange(comm, shipment.elements);
  shipment.elements.clear();
  result.piece = unpack(chunk, received, result.report);
  result.report.repeated_elements = comm.sum(result.report.repeated_elements);
  const RoutedFacets routed = route_facets(comm, result.piece, chunk.facet_nodes, chunk.facet_group);
  result.report.repeated_facets = routed.repeated;
  result.report.loose_facets = routed.loose;
  result.piece.facet_nodes = routed.nodes;
  result.piece.facet_group = routed.group;
  return result;
}

Mesh build_mesh(const Communicator& comm, MeshChunk chunk, std::vector<GlobalId>* numbers) {
  const std::string source = chunk.source;
  const DistributedPiece distributed = distribute_mesh(comm, std::move(chunk));
  const MeshPiece& piece = distributed.piece;
  for (std::size_t g = 0; g < piece.group_names.size(); ++g) {
    const GlobalId loose = distributed.report.loose_facets[g];
    if (loose == 0) continue;
    throw InputError(fmt::format("{}: {} {} of group '{}' are no {} of the mesh", source, loose,
                                 piece.dim == 3 ? "triangles" : "lines", piece.group_names[g],
                                 piece.dim == 3 ? "face of a tetrahedron" : "edge of a triangle"));
  }
  AssembledMesh assembled = assemble_mesh(comm, piece);
  if (numbers != nullptr) {
    numbers->resize(piece.node_numbers.size());
    for (std::size_t node = 0; node < piece.node_numbers.size(); ++node)
      (*numbers)[static_cast<std::size_t>(assembled.node_of_piece[node])] = piece.node_numbers[node];
  }
  return std::move(assembled.mesh);
}

}  // namespace malleus
