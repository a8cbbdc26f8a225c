#include "solvers/soft_pockets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "base/index.hpp"
#include "mesh/node_regions.hpp"
#include "mesh/simplex.hpp"
#include "parallel/sparse_exchange.hpp"
#include "solvers/viscosity_range.hpp"

namespace malleus {
namespace {

constexpr Real softness = 1.0 / 30.0;

/// Below this an element is soft. Collective.
Real soft_limit(const LinearSystem& system) {
  const auto [low, high] = viscosity_range(system);
  if (!(low < softness * high)) return 0;
  const Real middle = std::sqrt(low) * std::sqrt(high);
  std::array<Real, 2> sums{};
  for (std::size_t e = 0; e < system.element_viscosity.size(); ++e) {
    if (system.element_viscosity[e] < middle) continue;
    sums[0] += system.element_volume[e] * std::log(system.element_viscosity[e]);
    sums[1] += system.element_volume[e];
  }
  system.comm->sum_in_place(std::span(sums));
  return softness * std::exp(sums[0] / sums[1]);
}

using Corners = std::array<GlobalId, 4>;  ///< global nodes of an element; -1 beyond the last one in 2D

/// Whether the elements at a node hang together by facets that have it.
bool hang_together(int dim, std::span<const Corners> elements) {
  std::vector<bool> is_reached(elements.size(), false);
  std::vector<std::size_t> waiting = {0};
  is_reached[0] = true;
  std::size_t reached = 1;
  while (!waiting.empty()) {
    const Corners& corners = elements[waiting.back()];
    waiting.pop_back();
    for (std::size_t i = 0; i < elements.size(); ++i) {
      if (is_reached[i]) continue;
      const auto shared = std::count_if(elements[i].begin(), elements[i].end(), [&](GlobalId node) {
        return node >= 0 && std::find(corners.begin(), corners.end(), node) != corners.end();
      });
      if (shared < dim) continue;
      is_reached[i] = true;
      ++reached;
      waiting.push_back(i);
    }
  }
  return reached == elements.size();
}

class PocketFinder {
 public:
  PocketFinder(const LinearSystem& system, Real limit)
      : system_(system), mesh_(*system.mesh), limit_(limit), necks_(index(mesh_.nodes()), 0.0) {}

  SoftPockets run() {
    SoftPockets pockets;
    if (!find_regions()) return pockets;
    measure();
    pockets.of_node = keep_pockets(find_vented(), pockets);
    pockets.part.assign(pockets.of_node.size(), -1);
    if (!find_necks() || !find_regions()) return pockets;
    measure();
    const int open = pockets.open;
    pockets.part = keep_pockets(with_uncut(find_vented()), pockets);
    pockets.open = open;
    return pockets;
  }

 private:
  bool is_soft(LocalId element) const {
    const Real viscosity = system_.element_viscosity[index(element)];
    return viscosity > 0 && viscosity < limit_;
  }
  bool is_firm(LocalId element) const { return system_.element_viscosity[index(element)] >= limit_; }
  bool is_neck(LocalId node) const { return necks_[index(node)] > 0; }

  /// Regions of soft elements, which necks do not join. False where there are none.
  bool find_regions() {
    std::vector<LocalId> joined;
    regions_ = connected_regions(*system_.comm, mesh_, [&](LocalId element) {
      joined.clear();
      if (!is_soft(element)) return std::span<const LocalId>(joined);
      const auto nodes = mesh_.nodes_of_element(element);
      std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(joined), [&](LocalId n) { return !is_neck(n); });
      return std::span<const LocalId>(joined);
    });
    count_ = static_cast<std::size_t>(regions_.count);
    return count_ > 0;
  }

  /// Of a soft element; -1 where all its nodes are necks.
  std::int32_t region_of(LocalId element) const {
    std::int32_t region = -1;
    for (const LocalId node : mesh_.nodes_of_element(element)) region = std::max(region, regions_.of_node[index(node)]);
    return region;
  }

  /// [owned node] the soft elements at it, of all ranks; none where nothing firm touches the node. Collective.
  std::vector<std::vector<Corners>> soft_stars() const {
    std::vector<std::vector<Corners>> stars(index(mesh_.owned_nodes()));
    std::map<int, std::vector<GlobalId>> outgoing;
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      if (!is_soft(element)) continue;
      const auto nodes = mesh_.nodes_of_element(element);
      Corners corners = {-1, -1, -1, -1};
      std::transform(nodes.begin(), nodes.end(), corners.begin(), [&](LocalId n) { return mesh_.global_node(n); });
      for (const LocalId node : nodes) {
        if (node < mesh_.owned_nodes()) {
          if (touches_firm_[index(node)] > 0) stars[index(node)].push_back(corners);
          continue;
        }
        std::vector<GlobalId>& to = outgoing[mesh_.node_ownership.owner_of(mesh_.global_node(node))];
        to.push_back(mesh_.global_node(node));
        to.insert(to.end(), corners.begin(), corners.end());
      }
    }
    for (const auto& [rank, numbers] : sparse_exchange(*system_.comm, outgoing)) {
      for (std::size_t k = 0; k < numbers.size(); k += 5) {
        const auto node = static_cast<std::size_t>(numbers[k] - mesh_.node_ownership.begin());
        if (touches_firm_[node] > 0)
          stars[node].push_back({numbers[k + 1], numbers[k + 2], numbers[k + 3], numbers[k + 4]});
      }
    }
    return stars;
  }

  /// Nodes at which soft elements meet that share no facet there. False where there are none. Collective.
  bool find_necks() {
    const std::vector<std::vector<Corners>> stars = soft_stars();
    bool any = false;
    for (std::size_t node = 0; node < stars.size(); ++node) {
      if (stars[node].size() < 2 || hang_together(mesh_.dim, stars[node])) continue;
      necks_[node] = 1;
      any = true;
    }
    if (!system_.comm->any(any)) return false;
    mesh_.node_halo.update_copies(std::span(necks_), 1);
    return true;
  }

  /// The regions to leave out, and those that have no neck: they are no parts, but whole.
  std::vector<Real> with_uncut(std::vector<Real> left_out) const {
    std::vector<Real> is_cut(count_, 0.0);
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      if (!is_soft(element) || region_of(element) < 0) continue;
      const auto nodes = mesh_.nodes_of_element(element);
      const bool has_neck = std::any_of(nodes.begin(), nodes.end(), [&](LocalId node) { return is_neck(node); });
      if (has_neck) is_cut[static_cast<std::size_t>(region_of(element))] = 1;
    }
    system_.comm->max_in_place(std::span(is_cut));
    for (std::size_t region = 0; region < count_; ++region) {
      if (is_cut[region] == 0) left_out[region] = 1;
    }
    return left_out;
  }

  /// Volumes, numbers of nodes and the viscosities around the regions; where firm elements are.
  void measure() {
    volume_.assign(count_, 0.0);
    rim_.assign(count_, 0.0);
    nodes_.assign(count_, 0.0);
    std::vector<Real> around(2 * count_, 0.0);  // [region] volume times log viscosity, volume
    touches_firm_.assign(index(mesh_.nodes()), 0.0);
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      const auto nodes = mesh_.nodes_of_element(element);
      const Real volume = system_.element_volume[index(element)];
      if (is_soft(element) && region_of(element) >= 0) volume_[static_cast<std::size_t>(region_of(element))] += volume;
      if (!is_firm(element)) continue;
      add_rim(element);
      for (const LocalId node : nodes) {
        touches_firm_[index(node)] = 1;
        if (regions_.of_node[index(node)] < 0) continue;
        const auto region = static_cast<std::size_t>(regions_.of_node[index(node)]);
        around[2 * region] += volume * std::log(system_.element_viscosity[index(element)]);
        around[2 * region + 1] += volume;
      }
    }
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      if (regions_.of_node[index(node)] >= 0) nodes_[static_cast<std::size_t>(regions_.of_node[index(node)])] += 1;
    }
    for (std::vector<Real>* sums : {&volume_, &rim_, &nodes_, &around}) system_.comm->sum_in_place(std::span(*sums));
    mesh_.node_halo.max_to_owners(std::span(touches_firm_), 1);
    outside_.resize(count_);
    for (std::size_t region = 0; region < count_; ++region) {
      outside_[region] = around[2 * region + 1] > 0 ? std::exp(around[2 * region] / around[2 * region + 1]) : 0;
    }
  }

  void add_rim(LocalId element) {
    const auto nodes = mesh_.nodes_of_element(element);
    const int dim = mesh_.dim;
    const Real entry =
        system_.element_volume[index(element)] / system_.element_viscosity[index(element)] / ((dim + 1) * (dim + 2));
    for (const LocalId row : nodes) {
      const std::int32_t region = regions_.of_node[index(row)];
      if (region < 0) continue;
      for (const LocalId column : nodes) {
        if (regions_.of_node[index(column)] != region) continue;
        rim_[static_cast<std::size_t>(region)] += row == column ? 2 * entry : entry;
      }
    }
  }

  /// The change of a region's volume with the velocity of a node, c = sum V grad phi over its soft elements, is zero
  /// inside the region; where it is not, and the node can move along it and touches nothing firm, the region is open.
  std::vector<Real> find_vented() const {
    const auto dim = static_cast<std::size_t>(mesh_.dim);
    std::vector<Real> change(index(mesh_.nodes()) * dim, 0.0);
    with_dim(mesh_.dim, [&](auto d) {
      for (LocalId element = 0; element < mesh_.elements(); ++element) {
        if (!is_soft(element)) continue;
        const auto shape = p1_gradients<d>(simplex_points<d>(mesh_, element));
        const auto nodes = mesh_.nodes_of_element(element);
        for (int a = 0; a <= d; ++a) {
          for (int k = 0; k < d; ++k) {
            change[index(nodes[static_cast<std::size_t>(a)]) * dim + static_cast<std::size_t>(k)] +=
                shape.volume * shape.gradients(k, a);
          }
        }
      }
    });
    mesh_.node_halo.add_to_owners(std::span(change), mesh_.dim);
    std::vector<Real> vented(count_, 0.0);
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      if (regions_.of_node[index(node)] < 0 || touches_firm_[index(node)] > 0) continue;
      const auto region = static_cast<std::size_t>(regions_.of_node[index(node)]);
      Real* c = change.data() + index(node) * dim;
      system_.constraints->project(node, c);
      const Real size = std::sqrt(std::inner_product(c, c + dim, c, 0.0));
      const Real surface = std::pow(volume_[region], 1 - 1.0 / mesh_.dim);
      if (size > 1e-6 * surface / nodes_[region]) vented[region] = 1;
    }
    system_.comm->max_in_place(std::span(vented));
    return vented;
  }

  /// Appends the regions that are pockets; returns the pocket of each owned node, -1 = none.
  std::vector<std::int32_t> keep_pockets(const std::vector<Real>& left_out, SoftPockets& pockets) const {
    Real all = 0;
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      if (system_.element_viscosity[index(element)] > 0) all += system_.element_volume[index(element)];
    }
    all = system_.comm->sum(all);
    std::vector<std::int32_t> pocket_of(count_, -1);
    for (std::size_t region = 0; region < count_; ++region) {
      if (left_out[region] > 0 || outside_[region] <= 0 || volume_[region] > 0.5 * all) {
        ++pockets.open;
        continue;
      }
      pocket_of[region] = pockets.count();
      pockets.volume.push_back(volume_[region]);
      pockets.outside_viscosity.push_back(outside_[region]);
      pockets.rim.push_back(rim_[region]);
    }
    std::vector<std::int32_t> of_node(index(mesh_.owned_nodes()));
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      const std::int32_t region = regions_.of_node[index(node)];
      const bool counts = region >= 0 && !system_.constraints->is_pressure_fixed(node);
      of_node[index(node)] = counts ? pocket_of[static_cast<std::size_t>(region)] : -1;
    }
    return of_node;
  }

  const LinearSystem& system_;
  const Mesh& mesh_;
  Real limit_;
  std::vector<Real> necks_;  ///< [node] 1 = parts meet here, else 0
  NodeRegions regions_;
  std::size_t count_ = 0;
  std::vector<Real> volume_, rim_, nodes_, outside_;  ///< [region], on all ranks
  std::vector<Real> touches_firm_;                    ///< [owned node] 1 or 0
};

}  // namespace

SoftPockets find_soft_pockets(const LinearSystem& system) {
  const Real limit = soft_limit(system);
  if (limit <= 0) return {};
  return PocketFinder(system, limit).run();
}

}  // namespace malleus
