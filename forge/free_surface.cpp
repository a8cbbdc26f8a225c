#include "forge/free_surface.hpp"

#include <cmath>
#include <map>
#include <numbers>

#include "base/error.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus::forge {
namespace {

/// A share as it travels between ranks.
struct SentShare {
  GlobalId node;
  Real x, y, z;
};

SentShare packed(GlobalId node, const Vector& share) {
  return {node, share[0], share[1], share[2]};
}

using SharesOfNode = std::map<LocalId, std::vector<Vector>>;

/// This rank's part of the shares.
SharesOfNode local_shares(const Mesh& mesh, std::span<const LocalId> facets, Geometry geometry) {
  SharesOfNode shares;
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId facet : facets) {
      const FacetIntegrals<D> integrals = facet_integrals<D>(mesh, facet, geometry);
      const auto parts = integrals.shares();
      for (int k = 0; k < D; ++k) {
        const LocalId node = mesh.nodes_of_facet(facet)[static_cast<std::size_t>(k)];
        shares[node].push_back(parts[k] * to_vector(integrals.normal.data(), D));
      }
    }
  });
  return shares;
}

LocalId copy_of(const Mesh& mesh, GlobalId number) {
  const auto found = std::lower_bound(mesh.copy_numbers.begin(), mesh.copy_numbers.end(), number);
  check(found != mesh.copy_numbers.end() && *found == number, "a node's shares come to its holders");
  return mesh.owned_nodes() + static_cast<LocalId>(found - mesh.copy_numbers.begin());
}

/// Owners collect the shares of their nodes, their own first, then by rank, and send the whole to those who have some.
void complete_shares(const Communicator& comm, const Mesh& mesh, SharesOfNode& shares) {
  std::map<int, std::vector<SentShare>> to_owners;
  for (const auto& [node, parts] : shares) {
    if (node < mesh.owned_nodes()) continue;
    const GlobalId number = mesh.global_node(node);
    for (const Vector& part : parts) to_owners[mesh.node_ownership.owner_of(number)].push_back(packed(number, part));
  }
  const auto received = sparse_exchange(comm, to_owners);
  std::map<int, std::vector<LocalId>> askers;
  for (const auto& [rank, parts] : received) {
    for (const SentShare& part : parts) {
      const auto node = static_cast<LocalId>(part.node - mesh.node_ownership.begin());
      shares[node].emplace_back(part.x, part.y, part.z);
      if (askers[rank].empty() || askers[rank].back() != node) askers[rank].push_back(node);
    }
  }
  std::map<int, std::vector<SentShare>> to_holders;
  for (const auto& [rank, nodes] : askers) {
    for (const LocalId node : nodes) {
      for (const Vector& part : shares[node]) to_holders[rank].push_back(packed(mesh.global_node(node), part));
    }
  }
  for (auto& [node, parts] : shares) {
    if (node >= mesh.owned_nodes()) parts.clear();
  }
  for (const auto& [rank, parts] : sparse_exchange(comm, to_holders)) {
    for (const SentShare& part : parts) shares[copy_of(mesh, part.node)].emplace_back(part.x, part.y, part.z);
  }
}

}  // namespace

FreeSurface::FreeSurface(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::span<const char> is_free)
    : mesh_(&mesh) {
  node_body_.assign(static_cast<std::size_t>(mesh.nodes()), -1);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e)) {
      node_body_[static_cast<std::size_t>(node)] = mesh.element_region[static_cast<std::size_t>(e)];
    }
  }
  collect_facets(is_free, geometry);
  gather_shares(comm, geometry);
}

void FreeSurface::collect_facets(std::span<const char> is_free, Geometry geometry) {
  const auto is_on_axis = [&](LocalId facet) {
    const auto nodes = mesh_->nodes_of_facet(facet);
    return geometry == Geometry::axisymmetric && !(mesh_->point(nodes[0])[0] + mesh_->point(nodes[1])[0] > 0);
  };
  check(is_free.size() == mesh_->group_names.size() + 1, "every group is free or not");
  for (LocalId facet = 0; facet < mesh_->exterior_facets; ++facet) {
    const std::int32_t group = mesh_->facet_group[static_cast<std::size_t>(facet)];
    if (is_free[static_cast<std::size_t>(group + 1)] != 0 && !is_on_axis(facet)) facets_.push_back(facet);
  }
}

void FreeSurface::gather_shares(const Communicator& comm, Geometry geometry) {
  SharesOfNode shares = local_shares(*mesh_, facets_, geometry);
  complete_shares(comm, *mesh_, shares);
  for (const auto& [node, parts] : shares) {
    nodes_.push_back(node);
    if (node < mesh_->owned_nodes()) ++owned_;
    shares_.insert(shares_.end(), parts.begin(), parts.end());
    offsets_.push_back(shares_.size());
  }
}

std::size_t FreeSurface::find(LocalId node) const {
  const auto found = std::lower_bound(nodes_.begin(), nodes_.end(), node);
  check(found != nodes_.end() && *found == node, "the node lies on the free surface");
  return static_cast<std::size_t>(found - nodes_.begin());
}

Vector FreeSurface::normal(std::size_t i) const {
  Vector sum = Vector::Zero();
  for (const Vector& share : shares(i)) sum += share;
  const Real length = sum.norm();
  return length > 0 ? Vector(sum / length) : shares(i).front().normalized();
}

Real FreeSurface::area(std::size_t i) const {
  Real sum = 0;
  for (const Vector& share : shares(i)) sum += share.norm();
  return sum;
}

Real FreeSurface::facing_area(std::size_t i, const Vector& n) const {
  Real sum = 0;
  for (const Vector& share : shares(i)) sum += std::max(0.0, -share.dot(n));
  return sum;
}

Vector FreeSurface::corner_normal(LocalId facet, int k, Real feature_angle) const {
  const Real cosine = std::cos(feature_angle * std::numbers::pi / 180);
  Vector own;
  with_dim(mesh_->dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    const Point<D> area_normal = facet_area_normal<D>(facet_points<D>(*mesh_, facet));
    own = to_vector(area_normal.data(), D).normalized();
  });
  Vector sum = Vector::Zero();
  for (const Vector& share : shares(find(mesh_->nodes_of_facet(facet)[static_cast<std::size_t>(k)]))) {
    if (share.dot(own) > cosine * share.norm()) sum += share;
  }
  const Real length = sum.norm();
  return length > 0 ? Vector(sum / length) : own;
}

Real FreeSurface::mean_edge(const Communicator& comm, std::int32_t body) const {
  std::array<Real, 2> sums = {0, 0};
  for (const LocalId facet : facets_) {
    if (body_of_facet(facet) != body) continue;
    const auto nodes = mesh_->nodes_of_facet(facet);
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      if (mesh_->dim == 2 && k == 1) break;
      const Vector a = to_vector(mesh_->point(nodes[k]), mesh_->dim);
      const Vector b = to_vector(mesh_->point(nodes[(k + 1) % nodes.size()]), mesh_->dim);
      sums[0] += (a - b).norm();
      sums[1] += 1;
    }
  }
  comm.sum_in_place(sums);
  return sums[1] > 0 ? sums[0] / sums[1] : 0;
}

}  // namespace malleus::forge
