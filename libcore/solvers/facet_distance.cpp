#include "solvers/facet_distance.hpp"

#include <algorithm>
#include <map>
#include <queue>

#include "fem/cut_simplex.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// What a node tells the other holders of it.
struct SharedFacet {
  GlobalId node;
  std::array<Real, 9> vertices;
};

template <int D>
class FacetSearch {
 public:
  using Facet = Eigen::Matrix<Real, D, D>;

  FacetSearch(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph, Real limit)
      : comm_(comm), mesh_(mesh), graph_(graph) {
    distance_.assign(static_cast<std::size_t>(mesh.nodes()), limit);
    vertices_.resize(distance_.size());
    changed_.assign(distance_.size(), 0);
  }

  std::vector<Real> run(const std::vector<DistanceFacet>& facets) {
    for (const DistanceFacet& facet : facets) offer(facet.node, facet.vertices);
    do {
      spread();
    } while (comm_.any(swap_interfaces()));
    return std::move(distance_);
  }

 private:
  /// Takes the facet where it is nearer than the node's own. The margin lets roundoff end the exchange.
  void offer(LocalId node, const std::array<Real, 9>& vertices) {
    const auto n = static_cast<std::size_t>(node);
    const Point<D> at = Eigen::Map<const Point<D>>(mesh_.point(node));
    const Facet facet = Eigen::Map<const Facet>(vertices.data());
    const Real distance = (closest_point<D>(facet, at) - at).norm();
    if (!(distance < distance_[n] * (1 - 1e-12))) return;
    distance_[n] = distance;
    vertices_[n] = vertices;
    changed_[n] = 1;
    front_.emplace(distance, node);
  }

  void spread() {
    while (!front_.empty()) {
      const auto [distance, node] = front_.top();
      front_.pop();
      if (distance > distance_[static_cast<std::size_t>(node)]) continue;
      const std::array<Real, 9> vertices = vertices_[static_cast<std::size_t>(node)];
      for (const LocalId neighbour : graph_.of(node)) offer(neighbour, vertices);
    }
  }

  /// Copies tell owners, then owners tell copies. Returns whether anything changed here.
  bool swap_interfaces() {
    std::map<int, std::vector<SharedFacet>> to_owners;
    for (const Halo::Partner& partner : mesh_.node_halo.partners()) collect(partner.receives, to_owners[partner.rank]);
    for (const auto& [rank, offers] : sparse_exchange(comm_, to_owners)) take(offers);
    std::map<int, std::vector<SharedFacet>> to_copies;
    for (const Halo::Partner& partner : mesh_.node_halo.partners()) collect(partner.sends, to_copies[partner.rank]);
    std::fill(changed_.begin(), changed_.end(), 0);
    for (const auto& [rank, offers] : sparse_exchange(comm_, to_copies)) take(offers);
    return !front_.empty();
  }

  void collect(const std::vector<LocalId>& nodes, std::vector<SharedFacet>& offers) const {
    for (const LocalId node : nodes) {
      if (changed_[static_cast<std::size_t>(node)] != 0) {
        offers.push_back({mesh_.global_node(node), vertices_[static_cast<std::size_t>(node)]});
      }
    }
  }

  void take(const std::vector<SharedFacet>& offers) {
    for (const SharedFacet& shared : offers) {
      const auto& copies = mesh_.copy_numbers;
      const LocalId node =
          mesh_.node_ownership.owns(shared.node)
              ? static_cast<LocalId>(shared.node - mesh_.node_ownership.begin())
              : mesh_.owned_nodes() +
                    static_cast<LocalId>(std::lower_bound(copies.begin(), copies.end(), shared.node) - copies.begin());
      offer(node, shared.vertices);
    }
  }

  const Communicator& comm_;
  const Mesh& mesh_;
  const NodeGraph& graph_;
  std::vector<Real> distance_;
  std::vector<std::array<Real, 9>> vertices_;
  std::vector<char> changed_;  ///< since the other holders were last told
  using Entry = std::pair<Real, LocalId>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> front_;
};

}  // namespace

std::vector<Real> distance_to_facets(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph,
                                     const std::vector<DistanceFacet>& facets, Real limit) {
  return with_dim(mesh.dim,
                  [&](auto d) { return FacetSearch<decltype(d)::value>(comm, mesh, graph, limit).run(facets); });
}

}  // namespace malleus
