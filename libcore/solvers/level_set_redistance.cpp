#include "solvers/level_set_redistance.hpp"

#include <algorithm>
#include <cmath>

#include "fem/cut_simplex.hpp"
#include "fem/level_set_volume.hpp"
#include "solvers/facet_distance.hpp"

namespace malleus {
namespace {

constexpr Real steepest = 3;
constexpr Real share_allowed = 0.1;

template <int D>
Eigen::Matrix<Real, D + 1, 1> nodal_values(const Mesh& mesh, std::span<const Real> field, LocalId element) {
  Eigen::Matrix<Real, D + 1, 1> values;
  const auto nodes = mesh.nodes_of_element(element);
  for (int i = 0; i <= D; ++i) {
    values[i] = field[static_cast<std::size_t>(nodes[static_cast<std::size_t>(i)])];
  }
  return values;
}

/// Zero facets of the cut elements, offered to the nodes of their element.
template <int D>
std::vector<DistanceFacet> front_facets(const Mesh& mesh, std::span<const Real> level_set) {
  std::vector<DistanceFacet> facets;
  for (const LocalId e : cut_elements(mesh, level_set)) {
    const auto values = nodal_values<D>(mesh, level_set, e);
    const ZeroFacets<D> zero =
        zero_facets<D>(simplex_points<D>(mesh, e), {values.data(), static_cast<std::size_t>(D) + 1});
    for (int f = 0; f < zero.count; ++f) {
      DistanceFacet facet;
      Eigen::Map<typename ZeroFacets<D>::Facet>(facet.vertices.data()) = zero.facets[static_cast<std::size_t>(f)];
      for (const LocalId node : mesh.nodes_of_element(e)) {
        facet.node = node;
        facets.push_back(facet);
      }
    }
  }
  return facets;
}

/// A front that passes exactly through nodes cuts no element beside them; a nudge of a billionth of an edge inwards
/// gives it facets.
void leave_the_nodes(const Communicator& comm, const Mesh& mesh, std::span<const Real> measures,
                     std::span<Real> level_set) {
  Real total = 0;
  for (const Real measure : measures) total += measure;
  const Real edge =
      std::pow(comm.sum(total) / static_cast<Real>(std::max<GlobalId>(mesh.total_elements, 1)), 1.0 / mesh.dim);
  for (Real& value : level_set) {
    if (std::abs(value) < 1e-9 * edge) value = 1e-9 * edge;
  }
}

}  // namespace

FrontSlope front_slope(const Communicator& comm, const Mesh& mesh, std::span<const Real> level_set) {
  std::array<Real, 2> extremes = {-1e300, 0};  // largest of -slope and of slope
  std::array<GlobalId, 2> counts = {0, 0};
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId e : cut_elements(mesh, level_set)) {
      const auto gradients = p1_gradients<D>(simplex_points<D>(mesh, e)).gradients;
      const Real slope = (gradients * nodal_values<D>(mesh, level_set, e)).norm();
      extremes = {std::max(extremes[0], -slope), std::max(extremes[1], slope)};
      ++counts[0];
      if (slope > steepest || slope < 1 / steepest) ++counts[1];
    }
  });
  comm.max_in_place(extremes);
  comm.sum_in_place(counts);
  if (counts[0] == 0) return {};
  return {-extremes[0], extremes[1], static_cast<Real>(counts[1]) / static_cast<Real>(counts[0]), counts[0]};
}

bool should_redistance(const FrontSlope& slope) {
  return slope.share_outside > share_allowed;
}

void redistance(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph, std::span<const Real> measures,
                std::span<Real> level_set) {
  constexpr Real unreached = 1e300;
  const Real volume = positive_volume(comm, mesh, measures, level_set);
  leave_the_nodes(comm, mesh, measures, level_set);
  const auto facets = with_dim(mesh.dim, [&](auto d) { return front_facets<decltype(d)::value>(mesh, level_set); });
  if (!comm.any(!facets.empty())) return;
  const std::vector<Real> distance = distance_to_facets(comm, mesh, graph, facets, unreached);
  for (std::size_t n = 0; n < level_set.size(); ++n) {
    if (distance[n] < unreached) level_set[n] = level_set[n] > 0 ? distance[n] : -distance[n];
  }
  restore_volume(comm, mesh, measures, level_set, volume);
}

}  // namespace malleus
