#include "field/point_locator.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mesh/simplex.hpp"
#include "mesh/space_filling_curve.hpp"

namespace malleus {
namespace {

constexpr Real elements_per_cell = 2;

Box element_box(const Mesh& mesh, LocalId element) {
  Box box;
  for (const LocalId node : mesh.nodes_of_element(element)) box.add(mesh.point(node), mesh.dim);
  return box;
}

template <int D>
Location weigh(const Mesh& mesh, LocalId element, const Real* point) {
  const SimplexPoints<D> points = simplex_points<D>(mesh, element);
  const Eigen::Matrix<Real, D, D> edges = points.template rightCols<D>().colwise() - points.col(0);
  const Point<D> weights = edges.inverse() * (Eigen::Map<const Point<D>>(point) - points.col(0));
  Location location;
  location.element = element;
  location.weights[0] = 1 - weights.sum();
  location.inside = location.weights[0];
  for (int i = 0; i < D; ++i) {
    location.weights[static_cast<std::size_t>(i) + 1] = weights[i];
    location.inside = std::min(location.inside, weights[i]);
  }
  return location;
}

Location weigh(const Mesh& mesh, LocalId element, const Real* point) {
  return mesh.dim == 2 ? weigh<2>(mesh, element, point) : weigh<3>(mesh, element, point);
}

/// Calls visit with every cell of the grid that a box touches.
template <class Visit>
void for_each_cell(const std::array<int, 3>& low, const std::array<int, 3>& high, Visit visit) {
  for (int k = low[2]; k <= high[2]; ++k) {
    for (int j = low[1]; j <= high[1]; ++j) {
      for (int i = low[0]; i <= high[0]; ++i) visit(std::array<int, 3>{i, j, k});
    }
  }
}

}  // namespace

PointLocator::PointLocator(const Mesh& mesh) : mesh_(mesh), begin_{0, 0} {
  if (mesh.elements() == 0) return;
  Box box;
  for (LocalId node = 0; node < mesh.nodes(); ++node) box.add(mesh.point(node), mesh.dim);
  Real volume = 1;
  for (std::size_t c = 0; c < static_cast<std::size_t>(mesh.dim); ++c) {
    low_[c] = box.low[c];
    volume *= std::max(box.high[c] - box.low[c], 1e-300);
  }
  width_ = std::pow(volume * elements_per_cell / mesh.elements(), 1.0 / mesh.dim);
  for (std::size_t c = 0; c < static_cast<std::size_t>(mesh.dim); ++c) {
    counts_[c] = std::clamp(static_cast<int>((box.high[c] - box.low[c]) / width_) + 1, 1, 1024);
  }
  std::vector<LocalId> sizes(static_cast<std::size_t>(counts_[0]) * counts_[1] * counts_[2] + 1, 0);
  const auto for_each_entry = [&](auto visit) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const Box extent = element_box(mesh, e);
      for_each_cell(cell_of(extent.low.data()), cell_of(extent.high.data()),
                    [&](const auto& cell) { visit(index(cell), e); });
    }
  };
  for_each_entry([&](std::size_t cell, LocalId) { ++sizes[cell + 1]; });
  std::partial_sum(sizes.begin(), sizes.end(), sizes.begin());
  begin_ = sizes;
  elements_.resize(static_cast<std::size_t>(begin_.back()));
  for_each_entry([&](std::size_t cell, LocalId e) { elements_[static_cast<std::size_t>(sizes[cell]++)] = e; });
}

std::array<int, 3> PointLocator::cell_of(const Real* point) const {
  std::array<int, 3> cell = {0, 0, 0};
  for (std::size_t c = 0; c < static_cast<std::size_t>(mesh_.dim); ++c) {
    cell[c] = static_cast<int>(std::clamp((point[c] - low_[c]) / width_, 0.0, counts_[c] - 1.0));
  }
  return cell;
}

std::size_t PointLocator::index(const std::array<int, 3>& cell) const {
  return static_cast<std::size_t>(cell[0]) +
         static_cast<std::size_t>(counts_[0]) *
             (static_cast<std::size_t>(cell[1]) +
              static_cast<std::size_t>(counts_[1]) * static_cast<std::size_t>(cell[2]));
}

std::optional<Location> PointLocator::find(const Real* point, Real tolerance) const {
  if (elements_.empty()) return std::nullopt;
  const std::size_t cell = index(cell_of(point));
  std::optional<Location> best;
  for (LocalId i = begin_[cell]; i < begin_[cell + 1]; ++i) {
    const Location location = weigh(mesh_, elements_[static_cast<std::size_t>(i)], point);
    if (location.inside >= -tolerance && (!best || location.inside > best->inside)) best = location;
  }
  return best;
}

PointValues values_at_points(const Communicator& comm, const Mesh& mesh, const std::vector<const Field*>& fields,
                             std::span<const Real> points) {
  const auto dim = static_cast<std::size_t>(mesh.dim);
  const std::size_t count = points.size() / dim;
  const PointLocator locator(mesh);
  std::vector<std::optional<Location>> mine(count);
  std::vector<Real> score(count, -1e300);
  for (std::size_t i = 0; i < count; ++i) {
    mine[i] = locator.find(points.data() + i * dim);
    if (mine[i]) score[i] = mine[i]->inside;
  }
  std::vector<Real> best = score;
  comm.max_in_place(best);
  std::vector<Real> reader(count);
  for (std::size_t i = 0; i < count; ++i) reader[i] = mine[i] && score[i] == best[i] ? comm.rank() : comm.size();
  comm.min_in_place(reader);

  std::size_t width = 0;
  for (const Field* field : fields) width += static_cast<std::size_t>(field->components());
  PointValues result{std::vector<char>(count, 0), std::vector<Real>(count * width, 0.0)};
  for (std::size_t i = 0; i < count; ++i) {
    result.found[i] = reader[i] < comm.size() ? 1 : 0;
    if (reader[i] != comm.rank()) continue;
    Real* target = result.values.data() + i * width;
    const auto nodes = mesh.nodes_of_element(mine[i]->element);
    for (const Field* field : fields) {
      for (int c = 0; c < field->components(); ++c, ++target) {
        if (field->spec().support == Support::element) *target = field->at(mine[i]->element)[c];
        if (field->spec().support == Support::domain) *target = field->at(0)[c];
        if (field->spec().support != Support::node) continue;
        for (std::size_t k = 0; k < nodes.size(); ++k) *target += mine[i]->weights[k] * field->at(nodes[k])[c];
      }
    }
  }
  comm.sum_in_place(result.values);
  return result;
}

}  // namespace malleus
