#include "solvers/soft_pockets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "mesh/simplex.hpp"
#include "solvers/viscosity_range.hpp"

namespace malleus {
namespace {

constexpr Real softness = 1.0 / 30.0;
constexpr Real no_label = std::numeric_limits<Real>::max();
constexpr GlobalId most_pockets = 10'000;  ///< beyond, the sums over pockets would cost more than they save

std::size_t index(LocalId i) {
  return static_cast<std::size_t>(i);
}

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
    label_nodes();
    number_regions();
    if (labels_.empty()) return {};
    measure();
    return keep_pockets(find_vented());
  }

 private:
  bool is_soft(LocalId element) const {
    const Real viscosity = system_.element_viscosity[index(element)];
    return viscosity > 0 && viscosity < limit_;
  }
  bool is_firm(LocalId element) const { return system_.element_viscosity[index(element)] >= limit_; }

  /// label_: [node] the least global number of a node of its soft region.
  void label_nodes() {
    label_.assign(index(mesh_.nodes()), no_label);
    std::vector<LocalId> parent(index(mesh_.nodes()));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root_of = [&](LocalId node) {
      while (parent[index(node)] != node) node = parent[index(node)] = parent[index(parent[index(node)])];
      return node;
    };
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      if (!is_soft(element)) continue;
      const auto nodes = mesh_.nodes_of_element(element);
      for (const LocalId node : nodes) {
        label_[index(node)] = static_cast<Real>(mesh_.global_node(node));
        parent[index(root_of(node))] = root_of(nodes[0]);
      }
    }
    // Within a rank in one sweep; from rank to rank until nothing changes.
    std::vector<Real> before;
    do {
      before = label_;
      for (LocalId node = 0; node < mesh_.nodes(); ++node) {
        Real& least = label_[index(root_of(node))];
        least = std::min(least, label_[index(node)]);
      }
      for (LocalId node = 0; node < mesh_.nodes(); ++node) label_[index(node)] = label_[index(root_of(node))];
      mesh_.node_halo.min_to_owners(std::span(label_), 1);
      mesh_.node_halo.update_copies(std::span(label_), 1);
    } while (system_.comm->any(before != label_));
  }

  /// labels_: of all regions, increasing, on all ranks. region_: [node] place in labels_, -1 = none.
  void number_regions() {
    std::vector<GlobalId> mine;
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      if (label_[index(node)] == static_cast<Real>(mesh_.global_node(node))) mine.push_back(mesh_.global_node(node));
    }
    const auto count = static_cast<GlobalId>(mine.size());
    const GlobalId total = system_.comm->sum(count);
    if (total == 0 || total > most_pockets) return;
    labels_.assign(static_cast<std::size_t>(total), 0);
    const GlobalId first = system_.comm->sum_of_lower_ranks(count);
    std::copy(mine.begin(), mine.end(), labels_.begin() + first);
    system_.comm->sum_in_place(std::span(labels_));
    region_.resize(label_.size());
    std::transform(label_.begin(), label_.end(), region_.begin(), [&](Real label) {
      if (label == no_label) return -1;
      const auto place = std::lower_bound(labels_.begin(), labels_.end(), static_cast<GlobalId>(label));
      return static_cast<std::int32_t>(place - labels_.begin());
    });
  }

  /// Volumes, numbers of nodes and the viscosities around the regions; where firm elements are.
  void measure() {
    volume_.assign(labels_.size(), 0.0);
    nodes_.assign(labels_.size(), 0.0);
    std::vector<Real> around(2 * labels_.size(), 0.0);  // [region] volume times log viscosity, volume
    touches_firm_.assign(index(mesh_.nodes()), 0.0);
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      const auto nodes = mesh_.nodes_of_element(element);
      const Real volume = system_.element_volume[index(element)];
      if (is_soft(element)) volume_[static_cast<std::size_t>(region_[index(nodes[0])])] += volume;
      if (!is_firm(element)) continue;
      for (const LocalId node : nodes) {
        touches_firm_[index(node)] = 1;
        if (region_[index(node)] < 0) continue;
        const auto region = static_cast<std::size_t>(region_[index(node)]);
        around[2 * region] += volume * std::log(system_.element_viscosity[index(element)]);
        around[2 * region + 1] += volume;
      }
    }
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      if (region_[index(node)] >= 0) nodes_[static_cast<std::size_t>(region_[index(node)])] += 1;
    }
    for (std::vector<Real>* sums : {&volume_, &nodes_, &around}) system_.comm->sum_in_place(std::span(*sums));
    mesh_.node_halo.max_to_owners(std::span(touches_firm_), 1);
    outside_.resize(labels_.size());
    for (std::size_t region = 0; region < labels_.size(); ++region) {
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
    std::vector<Real> vented(labels_.size(), 0.0);
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      if (region_[index(node)] < 0 || touches_firm_[index(node)] > 0) continue;
      const auto region = static_cast<std::size_t>(region_[index(node)]);
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
    std::vector<std::int32_t> pocket_of(labels_.size(), -1);
    for (std::size_t region = 0; region < labels_.size(); ++region) {
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
      const std::int32_t region = region_[index(node)];
      const bool counts = region >= 0 && !system_.constraints->is_pressure_fixed(node);
      pockets.of_node[index(node)] = counts ? pocket_of[static_cast<std::size_t>(region)] : -1;
    }
    return pockets;
  }

  const LinearSystem& system_;
  const Mesh& mesh_;
  Real limit_;
  std::vector<Real> label_;
  std::vector<GlobalId> labels_;
  std::vector<std::int32_t> region_;
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
