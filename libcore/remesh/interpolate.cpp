#include "remesh/interpolate.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.hpp"
#include "remesh/locator.hpp"
#include "remesh/working_mesh.hpp"

namespace malleus {
namespace {

using namespace remeshing;

template <int D>
Point<D> point_at(const RemeshMesh& mesh, LocalId node) {
  Point<D> x;
  std::copy_n(mesh.point(node), D, x.begin());
  return x;
}

/// Cells of a regular grid with the elements whose centres they hold, for a first guess.
template <int D>
class CentreGrid {
 public:
  CentreGrid() = default;
  explicit CentreGrid(const std::vector<Point<D>>& centres) : centres_(centres) {
    low_.fill(1e300);
    Point<D> high;
    high.fill(-1e300);
    for (const auto& x : centres) {
      for (std::size_t i = 0; i < D; ++i) {
        low_[i] = std::min(low_[i], x[i]);
        high[i] = std::max(high[i], x[i]);
      }
    }
    Real side = 1e-300;
    for (std::size_t i = 0; i < D; ++i) side = std::max(side, high[i] - low_[i]);
    const Real wanted = std::ceil(std::pow(static_cast<Real>(centres.size()) / 4 + 1, 1.0 / D));
    cell_ = side / wanted;
    std::size_t total = 1;
    for (std::size_t i = 0; i < D; ++i) {
      count_[i] = static_cast<int>((high[i] - low_[i]) / cell_) + 1;
      total *= static_cast<std::size_t>(count_[i]);
    }
    start_.assign(total + 1, 0);
    for (const auto& x : centres) ++start_[index(cell_of(x)) + 1];
    for (std::size_t c = 0; c < total; ++c) start_[c + 1] += start_[c];
    std::vector<LocalId> next(start_.begin(), start_.end() - 1);
    items_.resize(centres.size());
    for (std::size_t e = 0; e < centres.size(); ++e)
      items_[static_cast<std::size_t>(next[index(cell_of(centres[e]))]++)] = static_cast<LocalId>(e);
  }

  /// The nearest centre that is accepted, -1 if there is none.
  template <class Accept>
  LocalId nearest(const Point<D>& x, Accept&& accept) const {
    const auto home = cell_of(x);
    const int widest = *std::max_element(count_.begin(), count_.end());
    LocalId best = -1;
    Real best_distance = 1e300;
    for (int ring = 0; ring <= widest; ++ring) {
      // A centre in ring r is at least (r - 1) cells away once x itself is inside the grid.
      if (best >= 0 && (ring - 1) * cell_ > std::sqrt(best_distance)) break;
      visit_ring(home, ring, [&](std::size_t cell) {
        for (LocalId n = start_[cell]; n < start_[cell + 1]; ++n) {
          const LocalId e = items_[static_cast<std::size_t>(n)];
          const Real distance = squared_distance<D>(x, centres_[static_cast<std::size_t>(e)]);
          if (distance >= best_distance || !accept(e)) continue;
          best_distance = distance;
          best = e;
        }
      });
    }
    return best;
  }

 private:
  using Index = std::array<int, D>;
  Index cell_of(const Point<D>& x) const {
    Index cell;
    for (std::size_t i = 0; i < D; ++i)
      cell[i] = static_cast<int>(std::clamp(std::floor((x[i] - low_[i]) / cell_), 0.0, count_[i] - 1.0));
    return cell;
  }
  std::size_t index(const Index& cell) const {
    std::size_t number = 0;
    for (std::size_t i = D; i-- > 0;)
      number = number * static_cast<std::size_t>(count_[i]) + static_cast<std::size_t>(cell[i]);
    return number;
  }
  template <class Visit>
  void visit_ring(const Index& home, int ring, Visit&& visit) const {
    Index offset;
    offset.fill(-ring);
    while (true) {
      bool on_ring = false;
      bool inside = true;
      Index cell;
      for (std::size_t i = 0; i < D; ++i) {
        on_ring = on_ring || std::abs(offset[i]) == ring;
        cell[i] = home[i] + offset[i];
        inside = inside && cell[i] >= 0 && cell[i] < count_[i];
      }
      if (on_ring && inside) visit(index(cell));
      std::size_t axis = 0;
      while (axis < D && ++offset[axis] > ring) offset[axis++] = -ring;
      if (axis == D) return;
    }
  }

  std::vector<Point<D>> centres_;
  Point<D> low_{};
  Real cell_ = 1;
  Index count_{};
  std::vector<LocalId> start_;
  std::vector<LocalId> items_;
};

template <int D>
class Finder {
 public:
  explicit Finder(const RemeshMesh& mesh) : region_(mesh.element_region) {
    std::vector<Element<D>> elements(region_.size());
    for (std::size_t e = 0; e < elements.size(); ++e) {
      const auto nodes = mesh.nodes_of_element(static_cast<LocalId>(e));
      std::copy(nodes.begin(), nodes.end(), elements[e].node.begin());
    }
    connect_elements<D>(elements, mesh.nodes());
    std::vector<Point<D>> points(static_cast<std::size_t>(mesh.nodes()));
    for (LocalId v = 0; v < mesh.nodes(); ++v) points[static_cast<std::size_t>(v)] = point_at<D>(mesh, v);
    std::vector<typename Locator<D>::Cell> cells(elements.size());
    std::vector<Point<D>> centres(elements.size());
    for (std::size_t e = 0; e < elements.size(); ++e) {
      cells[e].node = elements[e].node;
      for (std::size_t f = 0; f <= D; ++f) {
        const FaceRef ref = elements[e].neighbour[f];
        cells[e].neighbour[f] = ref == no_face ? -1 : element_of(ref);
        centres[e] = shifted<D>(centres[e], points[static_cast<std::size_t>(elements[e].node[f])], 1.0 / (D + 1));
      }
    }
    grid_ = CentreGrid<D>(centres);
    locator_ = Locator<D>(std::move(points), std::move(cells));
  }

  void locate(std::span<const Real> points, std::span<const std::int32_t> region, PointLocations& result) const {
    LocalId at = -1;
    for (std::size_t n = 0; n * D < points.size(); ++n) {
      Point<D> x;
      std::copy_n(points.begin() + static_cast<std::ptrdiff_t>(n * D), D, x.begin());
      const bool any = region.empty();
      const auto accept = [&](LocalId e) { return any || region_[static_cast<std::size_t>(e)] == region[n]; };
      typename Locator<D>::Hit hit;
      hit.outside = 1e300;
      if (at >= 0 && accept(at)) hit = locator_.walk(x, at);
      if (hit.outside > 1e-9 || (!any && !accept(hit.cell))) {
        LocalId start = grid_.nearest(x, accept);
        if (start < 0) start = grid_.nearest(x, [](LocalId) { return true; });
        const auto again = locator_.walk(x, start);
        if (again.outside < hit.outside || hit.cell < 0) hit = again;
      }
      at = hit.cell;
      result.element.push_back(hit.cell);
      result.weights.insert(result.weights.end(), hit.weights.begin(), hit.weights.end());
    }
  }

 private:
  std::vector<std::int32_t> region_;
  Locator<D> locator_;
  CentreGrid<D> grid_;
};

/// Points spread in a simplex: the centre, and points towards each corner and each edge.
template <int D>
std::vector<std::array<Real, D + 1>> sample_weights() {
  std::vector<std::array<Real, D + 1>> samples;
  constexpr Real centre = 1.0 / (D + 1);
  for (std::size_t i = 0; i <= D; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      std::array<Real, D + 1> weights;
      weights.fill(0.4 * centre);
      weights[i] += 0.3;
      weights[j] += 0.3;
      samples.push_back(weights);
    }
  }
  return samples;
}

template <int D>
std::vector<Real> sample_points(const RemeshMesh& mesh, std::vector<std::int32_t>& region) {
  const auto samples = sample_weights<D>();
  std::vector<Real> points;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (const auto& weights : samples) {
      Point<D> x{};
      for (std::size_t k = 0; k <= D; ++k) x = shifted<D>(x, point_at<D>(mesh, nodes[k]), weights[k]);
      points.insert(points.end(), x.begin(), x.end());
      region.push_back(mesh.element_region[static_cast<std::size_t>(e)]);
    }
  }
  return points;
}

std::vector<Real> volumes_of(const RemeshMesh& mesh) {
  std::vector<Real> volumes;
  RemeshMesh one;
  one.dimension = mesh.dimension;
  const auto each = [&]<int D>(std::integral_constant<int, D>) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      std::array<Point<D>, D + 1> x;
      PointPointers<D> pointers;
      for (std::size_t k = 0; k <= D; ++k) {
        x[k] = point_at<D>(mesh, mesh.nodes_of_element(e)[k]);
        pointers[k] = &x[k];
      }
      volumes.push_back(scaled_volume<D>(pointers) / factorial<D>);
    }
  };
  mesh.dimension == 2 ? each(std::integral_constant<int, 2>{}) : each(std::integral_constant<int, 3>{});
  return volumes;
}

/// Integral and sign of one component over one region.
struct RegionSum {
  Real integral = 0;
  Real volume = 0;
  bool one_sign = true;
  Real sign = 0;
};

std::map<std::int32_t, RegionSum> region_sums(const RemeshMesh& mesh, std::span<const Real> volumes,
                                              std::span<const Real> values, std::size_t components,
                                              std::size_t component) {
  std::map<std::int32_t, RegionSum> sums;
  for (std::size_t e = 0; e < volumes.size(); ++e) {
    RegionSum& sum = sums[mesh.element_region[e]];
    const Real value = values[e * components + component];
    sum.integral += value * volumes[e];
    sum.volume += volumes[e];
    if (value * sum.sign < 0) sum.one_sign = false;
    if (value != 0 && sum.sign == 0) sum.sign = value;
  }
  return sums;
}

void restore_integrals(const RemeshMesh& old_mesh, const RemeshMesh& new_mesh, std::span<const Real> old_values,
                       std::vector<Real>& values, std::size_t components) {
  const std::vector<Real> old_volumes = volumes_of(old_mesh);
  const std::vector<Real> new_volumes = volumes_of(new_mesh);
  for (std::size_t c = 0; c < components; ++c) {
    auto before = region_sums(old_mesh, old_volumes, old_values, components, c);
    const auto after = region_sums(new_mesh, new_volumes, values, components, c);
    for (std::size_t e = 0; e < new_volumes.size(); ++e) {
      const RegionSum& was = before[new_mesh.element_region[e]];
      const RegionSum& is = after.at(new_mesh.element_region[e]);
      Real& value = values[e * components + c];
      if (was.one_sign && is.one_sign && is.integral != 0) {
        value *= was.integral / is.integral;
      } else if (is.volume != 0) {
        value += (was.integral - is.integral) / is.volume;
      }
    }
  }
}

}  // namespace

struct PointLocator::Data {
  int dimension;
  std::unique_ptr<Finder<2>> flat;
  std::unique_ptr<Finder<3>> solid;
};

PointLocator::PointLocator(const RemeshMesh& mesh) : data_(std::make_unique<Data>()) {
  if (mesh.elements() == 0) throw InputError("interpolation: the old mesh has no elements");
  data_->dimension = mesh.dimension;
  if (mesh.dimension == 2) {
    data_->flat = std::make_unique<Finder<2>>(mesh);
  } else {
    data_->solid = std::make_unique<Finder<3>>(mesh);
  }
}
PointLocator::PointLocator(PointLocator&&) noexcept = default;
PointLocator& PointLocator::operator=(PointLocator&&) noexcept = default;
PointLocator::~PointLocator() = default;

PointLocations PointLocator::locate(std::span<const Real> points, std::span<const std::int32_t> region) const {
  PointLocations result;
  if (data_->dimension == 2) {
    data_->flat->locate(points, region, result);
  } else {
    data_->solid->locate(points, region, result);
  }
  return result;
}

std::vector<Real> interpolate(const RemeshMesh& old_mesh, const PointLocations& at, std::span<const Real> values,
                              int components) {
  const auto stride = static_cast<std::size_t>(old_mesh.dimension) + 1;
  const auto width = static_cast<std::size_t>(components);
  std::vector<Real> result(at.element.size() * width, 0);
  for (std::size_t n = 0; n < at.element.size(); ++n) {
    const auto nodes = old_mesh.nodes_of_element(at.element[n]);
    for (std::size_t k = 0; k < stride; ++k) {
      for (std::size_t c = 0; c < width; ++c)
        result[n * width + c] += at.weights[n * stride + k] * values[static_cast<std::size_t>(nodes[k]) * width + c];
    }
  }
  return result;
}

std::vector<Real> transfer_elements(const RemeshMesh& old_mesh, const RemeshMesh& new_mesh,
                                    std::span<const Real> values, int components, bool conserve) {
  const auto width = static_cast<std::size_t>(components);
  std::vector<Real> result(static_cast<std::size_t>(new_mesh.elements()) * width, 0);
  if (new_mesh.elements() == 0) return result;
  std::vector<std::int32_t> region;
  const bool flat = old_mesh.dimension == 2;
  const std::vector<Real> points = flat ? sample_points<2>(new_mesh, region) : sample_points<3>(new_mesh, region);
  const std::size_t samples = flat ? sample_weights<2>().size() : sample_weights<3>().size();
  const PointLocations at = PointLocator(old_mesh).locate(points, region);
  for (std::size_t n = 0; n < at.element.size(); ++n) {
    for (std::size_t c = 0; c < width; ++c)
      result[n / samples * width + c] +=
          values[static_cast<std::size_t>(at.element[n]) * width + c] / static_cast<Real>(samples);
  }
  if (conserve) restore_integrals(old_mesh, new_mesh, values, result, width);
  return result;
}

}  // namespace malleus
