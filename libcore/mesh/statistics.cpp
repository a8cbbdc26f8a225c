#include "mesh/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "mesh/simplex.hpp"

namespace malleus {
namespace {

constexpr std::size_t fine_bins = 1000;
constexpr int quality_bins = 10;

/// Calls back with each value of a quantity; used twice, for the range and for the bins.
using ForEachValue = std::function<void(const std::function<void(Real)>&)>;

struct Range {
  Real min = 1e300;
  Real max = -1e300;
  Real sum = 0;
  GlobalId count = 0;
};

Range find_range(const Communicator& comm, const ForEachValue& for_each) {
  Range range;
  for_each([&](Real value) {
    range.min = std::min(range.min, value);
    range.max = std::max(range.max, value);
    range.sum += value;
    ++range.count;
  });
  range.min = comm.min(range.min);
  range.max = comm.max(range.max);
  range.sum = comm.sum(range.sum);
  range.count = comm.sum(range.count);
  return range;
}

/// The value below which a share of the others lies, from 1000 equal bins over the range.
Real quantile(const Communicator& comm, const ForEachValue& for_each, const Range& range, Real share) {
  std::vector<GlobalId> bins(fine_bins, 0);
  const Real width = (range.max - range.min) / fine_bins;
  if (!(width > 0)) return range.min;
  for_each([&](Real value) { ++bins[std::min(static_cast<std::size_t>((value - range.min) / width), fine_bins - 1)]; });
  comm.sum_in_place(std::span(bins));
  const Real wanted = share * static_cast<Real>(range.count);
  Real below = 0;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const auto here = static_cast<Real>(bins[i]);
    if (below + here >= wanted && here > 0) {
      return range.min + width * (static_cast<Real>(i) + (wanted - below) / here);
    }
    below += here;
  }
  return range.max;
}

Distribution describe(const Communicator& comm, const ForEachValue& for_each, const Range& range) {
  Distribution result;
  if (range.count == 0) return result;
  result.min = range.min;
  result.max = range.max;
  result.mean = range.sum / static_cast<Real>(range.count);
  result.p01 = quantile(comm, for_each, range, 0.01);
  return result;
}

template <int D>
Distribution quality_of(const Communicator& comm, const Mesh& mesh) {
  const ForEachValue for_each = [&](const std::function<void(Real)>& visit) {
    for (LocalId e = 0; e < mesh.elements(); ++e) visit(simplex_quality<D>(simplex_points<D>(mesh, e)));
  };
  Distribution result = describe(comm, for_each, find_range(comm, for_each));
  result.bins.assign(quality_bins, 0);
  for_each([&](Real q) {
    const int bin = std::clamp(static_cast<int>(q * quality_bins), 0, quality_bins - 1);
    ++result.bins[static_cast<std::size_t>(bin)];
  });
  comm.sum_in_place(std::span(result.bins));
  return result;
}

template <int D>
Distribution edges_of(const Communicator& comm, const Mesh& mesh) {
  const ForEachValue for_each = [&](const std::function<void(Real)>& visit) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const SimplexPoints<D> points = simplex_points<D>(mesh, e);
      for (int i = 0; i <= D; ++i) {
        for (int j = 0; j < i; ++j) visit((points.col(i) - points.col(j)).norm());
      }
    }
  };
  Distribution result = describe(comm, for_each, find_range(comm, for_each));
  if (!(result.min > 0)) return result;
  const int first = std::ilogb(result.min);
  result.first_edge = std::ldexp(1.0, first);
  result.bins.assign(static_cast<std::size_t>(std::ilogb(result.max) - first) + 1, 0);
  for_each([&](Real length) { ++result.bins[static_cast<std::size_t>(std::ilogb(length) - first)]; });
  comm.sum_in_place(std::span(result.bins));
  return result;
}

template <int D>
void add_regions(const Communicator& comm, const Mesh& mesh, MeshStatistics& result) {
  std::vector<GlobalId> counts(mesh.region_names.size() + 1, 0);
  std::vector<Real> volumes(counts.size(), 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto region = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
    ++counts[region];
    volumes[region] += simplex_volume<D>(simplex_points<D>(mesh, e));
  }
  comm.sum_in_place(std::span(counts));
  comm.sum_in_place(std::span(volumes));
  for (std::size_t i = 0; i < mesh.region_names.size(); ++i) {
    result.regions.push_back({mesh.region_names[i], counts[i], volumes[i]});
  }
  result.volume = std::accumulate(volumes.begin(), volumes.end(), 0.0);
}

template <int D>
Real facet_area(const Mesh& mesh, LocalId facet) {
  const auto nodes = mesh.nodes_of_facet(facet);
  const auto point = [&](std::size_t k) { return Point<D>(Eigen::Map<const Point<D>>(mesh.point(nodes[k]))); };
  if constexpr (D == 2) return (point(1) - point(0)).norm();
  if constexpr (D == 3) return 0.5 * (point(1) - point(0)).cross(point(2) - point(0)).norm();
}

/// The last entry of the lists is of facets without a group.
template <int D>
void add_groups(const Communicator& comm, const Mesh& mesh, MeshStatistics& result) {
  const std::size_t unnamed = mesh.group_names.size();
  std::vector<GlobalId> counts(unnamed + 1, 0);
  std::vector<Real> areas(counts.size(), 0);
  Real exterior = 0;
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    const std::int32_t group = mesh.facet_group[static_cast<std::size_t>(f)];
    const std::size_t entry = group < 0 ? unnamed : static_cast<std::size_t>(group);
    const Real area = facet_area<D>(mesh, f);
    ++counts[entry];
    areas[entry] += area;
    if (f < mesh.exterior_facets) exterior += area;
  }
  comm.sum_in_place(std::span(counts));
  comm.sum_in_place(std::span(areas));
  for (std::size_t i = 0; i < unnamed; ++i) result.groups.push_back({mesh.group_names[i], counts[i], areas[i]});
  result.unnamed_exterior_facets = counts[unnamed];
  result.exterior_facets = comm.sum(GlobalId{mesh.exterior_facets});
  result.area = comm.sum(exterior);
}

}  // namespace

MeshStatistics mesh_statistics(const Communicator& comm, const Mesh& mesh) {
  MeshStatistics result;
  result.dim = mesh.dim;
  result.nodes = mesh.total_nodes();
  result.elements = mesh.total_elements;
  result.fewest_elements_of_a_rank = comm.min(GlobalId{mesh.elements()});
  result.most_elements_of_a_rank = comm.max(GlobalId{mesh.elements()});
  result.box = bounding_box(comm, mesh.coordinates, mesh.dim);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    add_regions<D>(comm, mesh, result);
    add_groups<D>(comm, mesh, result);
    result.quality = quality_of<D>(comm, mesh);
    result.edges = edges_of<D>(comm, mesh);
  });
  return result;
}

}  // namespace malleus
