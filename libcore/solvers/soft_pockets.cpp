#include "solvers/soft_pockets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/index.hpp"
#include "mesh/node_regions.hpp"
#include "mesh/simplex.hpp"
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

class PocketFinder {
 public:
  PocketFinder(const LinearSystem& system, Real limit) : system_(system), mesh_(*system.mesh), limit_(limit) {}

  SoftPockets run() {
    find_regions();
    if (count_ == 0) return {};
    measure();
    return keep_pockets(find_vented());
  }

 private:
  bool is_soft(LocalId element) const {
    const Real viscosity = system_.element_viscosity[index(element)];
    return viscosity > 0 && viscosity < limit_;
  }
  bool is_firm(LocalId element) const { return system_.element_viscosity[index(element)] >= limit_; }

  void find_regions() {
    const std::span<const LocalId> nothing;
    regions_ = connected_regions(*system_.comm, mesh_, [&](LocalId element) {
      return is_soft(element) ? std::span<const LocalId>(mesh_.nodes_of_element(element)) : nothing;
    });
    count_ = static_cast<std::size_t>(regions_.count);
  }

  /// Volumes, numbers of nodes and the viscosities around the regions; where firm elements are.
  void measure() {
    volume_.assign(count_, 0.0);
    nodes_.assign(count_, 0.0);
    std::vector<Real> around(2 * count_, 0.0);  // [region] volume times log viscosity, volume
    touches_firm_.assign(index(mesh_.nodes()), 0.0);
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      const auto nodes = mesh_.nodes_of_element(element);
      const Real volume = system_.element_volume[index(element)];
      if (is_soft(element)) volume_[static_cast<std::size_t>(regions_.of_node[index(nodes[0])])] += volume;
      if (!is_firm(element)) continue;
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
    for (std::vector<Real>* sums : {&volume_, &nodes_, &around}) system_.comm->sum_in_place(std::span(*sums));
    mesh_.node_halo.max_to_owners(std::span(touches_firm_), 1);
    outside_.resize(count_);
    for (std::size_t region = 0; region < count_; ++region) {
      outside_[region] = around[2 * region + 1] > 0 ? std::exp(around[2 * region] / around[2 * region + 1]) : 0;
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

  SoftPockets keep_pockets(const std::vector<Real>& vented) const {
    Real all = 0;
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      if (system_.element_viscosity[index(element)] > 0) all += system_.element_volume[index(element)];
    }
    all = system_.comm->sum(all);
    SoftPockets pockets;
    std::vector<std::int32_t> pocket_of(count_, -1);
    for (std::size_t region = 0; region < count_; ++region) {
      if (vented[region] > 0 || outside_[region] <= 0 || volume_[region] > 0.5 * all) {
        ++pockets.open;
        continue;
      }
      pocket_of[region] = pockets.count();
      pockets.volume.push_back(volume_[region]);
      pockets.outside_viscosity.push_back(outside_[region]);
    }
    pockets.of_node.resize(index(mesh_.owned_nodes()));
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      const std::int32_t region = regions_.of_node[index(node)];
      const bool counts = region >= 0 && !system_.constraints->is_pressure_fixed(node);
      pockets.of_node[index(node)] = counts ? pocket_of[static_cast<std::size_t>(region)] : -1;
    }
    return pockets;
  }

  const LinearSystem& system_;
  const Mesh& mesh_;
  Real limit_;
  NodeRegions regions_;
  std::size_t count_ = 0;
  std::vector<Real> volume_, nodes_, outside_;  ///< [region], on all ranks
  std::vector<Real> touches_firm_;              ///< [owned node] 1 or 0
};

}  // namespace

SoftPockets find_soft_pockets(const LinearSystem& system) {
  const Real limit = soft_limit(system);
  if (limit <= 0) return {};
  return PocketFinder(system, limit).run();
}

}  // namespace malleus
