#include "solvers/level_set_transport.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.hpp"
#include "fem/level_set_volume.hpp"

namespace malleus {
namespace {

/// Away from the front the level set is smooth, and longer steps do no harm up to here.
constexpr Real far_cfl = 10;

template <int D>
Eigen::Matrix<Real, D, D + 1> nodal_vectors(const Mesh& mesh, std::span<const Real> field, LocalId element) {
  Eigen::Matrix<Real, D, D + 1> vectors;
  const auto nodes = mesh.nodes_of_element(element);
  for (int i = 0; i <= D; ++i) {
    const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(i)]);
    vectors.col(i) = Eigen::Map<const Point<D>>(field.data() + node * D);
  }
  return vectors;
}

Real longest_edge(const Mesh& mesh, LocalId element) {
  return with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    const SimplexPoints<D> points = simplex_points<D>(mesh, element);
    Real square = 0;
    for (int i = 0; i <= D; ++i) {
      for (int j = 0; j < i; ++j) square = std::max(square, (points.col(i) - points.col(j)).squaredNorm());
    }
    return std::sqrt(square);
  });
}

}  // namespace

LevelSetTransport::LevelSetTransport(const Communicator& comm, const Mesh& mesh, const NodeGraph& graph,
                                     TransportOptions options)
    : comm_(comm), mesh_(mesh), graph_(graph), options_(options), slots_(build_element_slots(mesh, graph)) {
  left_.entries.assign(graph.neighbours.size(), 0);
  convection_.entries.assign(graph.neighbours.size(), 0);
  rates_.assign(static_cast<std::size_t>(mesh.nodes()), 0);
  active_elements_.resize(static_cast<std::size_t>(mesh.elements()));
  std::iota(active_elements_.begin(), active_elements_.end(), 0);
  active_rows_.resize(static_cast<std::size_t>(mesh.nodes()));
  std::iota(active_rows_.begin(), active_rows_.end(), 0);
}

TransportReport LevelSetTransport::advance(std::span<const Real> velocity, std::span<Real> level_set, Real dt,
                                           const ImposedLevelSet& imposed) {
  check(dt > 0, "a transport step takes time");
  compute_rates(velocity);
  TransportReport report;
  report.front_cfl = dt * largest_front_rate(level_set);
  Real left = dt;
  Real step = 0;
  Real assembled_step = 0;
  for (int steps_left = 0; left > 0; --steps_left) {
    if (options_.narrow_band > 0) choose_active(level_set);
    const Real limit = largest_step(level_set);
    if (steps_left == 0 || step > limit * 1.0001 || (step < 0.4 * limit && steps_left > 2)) {
      steps_left = std::max(1, static_cast<int>(std::ceil(left / limit - 1e-9)));
      step = left / steps_left;
    }
    if (options_.narrow_band > 0 || std::abs(step - assembled_step) > 1e-9 * step) {
      assemble(velocity, step);
      assembled_step = step;
    }
    substep(level_set, step, step / left, imposed, report);
    left = steps_left == 1 ? 0 : left - step;
  }
  return report;
}

Real LevelSetTransport::front_rate(std::span<const Real> velocity, std::span<const Real> level_set) {
  compute_rates(velocity);
  return largest_front_rate(level_set);
}

/// A column a vertex.
template <int D>
Eigen::Matrix<Real, D, D + 1> LevelSetTransport::velocities_of(std::span<const Real> velocity, LocalId element) const {
  Eigen::Matrix<Real, D, D + 1> velocities = nodal_vectors<D>(mesh_, velocity, element);
  if (!subscales_.empty()) {
    velocities.colwise() += Eigen::Map<const Point<D>>(subscales_.data() + static_cast<std::size_t>(element) * D);
  }
  return velocities;
}

void LevelSetTransport::compute_rates(std::span<const Real> velocity) {
  std::vector<Real> sums(2 * rates_.size(), 0);  // [node] volume times rate, volume
  with_dim(mesh_.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      const Point<D> mean = velocities_of<D>(velocity, e).rowwise().mean();
      const auto p1 = p1_gradients<D>(simplex_points<D>(mesh_, e));
      const Real crossed = p1.volume * streamline_rate<D>(p1, mean);
      for (const LocalId node : mesh_.nodes_of_element(e)) {
        sums[2 * static_cast<std::size_t>(node)] += crossed;
        sums[2 * static_cast<std::size_t>(node) + 1] += p1.volume;
      }
    }
  });
  mesh_.node_halo.add_to_owners(sums, 2);
  mesh_.node_halo.update_copies(sums, 2);
  for (std::size_t n = 0; n < rates_.size(); ++n) rates_[n] = sums[2 * n + 1] > 0 ? sums[2 * n] / sums[2 * n + 1] : 0;
}

std::vector<char> LevelSetTransport::mark_nodes(std::span<const char> element_marks) const {
  std::vector<Real> marks(static_cast<std::size_t>(mesh_.nodes()), 0);
  for (LocalId e = 0; e < mesh_.elements(); ++e) {
    if (element_marks[static_cast<std::size_t>(e)] == 0) continue;
    for (const LocalId node : mesh_.nodes_of_element(e)) marks[static_cast<std::size_t>(node)] = 1;
  }
  mesh_.node_halo.max_to_owners(marks, 1);
  mesh_.node_halo.update_copies(marks, 1);
  return {marks.begin(), marks.end()};
}

Real LevelSetTransport::largest_front_rate(std::span<const Real> level_set) const {
  // Elements that the front only touches count: it may stand on the faces of a gate.
  std::vector<char> is_touched(static_cast<std::size_t>(mesh_.elements()), 0);
  for (LocalId e = 0; e < mesh_.elements(); ++e) {
    bool has_inside = false, has_outside = false;
    for (const LocalId n : mesh_.nodes_of_element(e)) {
      has_inside = has_inside || level_set[static_cast<std::size_t>(n)] >= 0;
      has_outside = has_outside || level_set[static_cast<std::size_t>(n)] <= 0;
    }
    is_touched[static_cast<std::size_t>(e)] = has_inside && has_outside;
  }
  const std::vector<char> near = mark_nodes(is_touched);
  Real rate = 0;
  for (std::size_t n = 0; n < rates_.size(); ++n) {
    if (near[n] != 0) rate = std::max(rate, rates_[n]);
  }
  return comm_.max(rate);
}

Real LevelSetTransport::largest_step(std::span<const Real> level_set) const {
  Real anywhere = 0;
  for (const LocalId n : active_rows_) anywhere = std::max(anywhere, rates_[static_cast<std::size_t>(n)]);
  const Real rate = std::max(largest_front_rate(level_set) / options_.front_cfl, comm_.max(anywhere) / far_cfl);
  return rate > 0 ? 1 / rate : 1e300;
}

void LevelSetTransport::choose_active(std::span<Real> level_set) {
  Real size = 0;
  for (const LocalId e : cut_elements(mesh_, level_set)) size = std::max(size, longest_edge(mesh_, e));
  band_width_ = options_.narrow_band * comm_.max(size);
  if (band_width_ == 0) return;
  clip(level_set);
  std::vector<char> is_inner(static_cast<std::size_t>(mesh_.elements()), 0);
  for (LocalId e = 0; e < mesh_.elements(); ++e) {
    const auto nodes = mesh_.nodes_of_element(e);
    is_inner[static_cast<std::size_t>(e)] = std::any_of(nodes.begin(), nodes.end(), [&](LocalId n) {
      return std::abs(level_set[static_cast<std::size_t>(n)]) < band_width_;
    });
  }
  // Every element of an active node is assembled: beyond them the level set is constant and adds nothing to its row.
  const std::vector<char> active = mark_nodes(is_inner);
  active_rows_.clear();
  for (LocalId n = 0; n < mesh_.nodes(); ++n) {
    if (active[static_cast<std::size_t>(n)] != 0) active_rows_.push_back(n);
  }
  active_elements_.clear();
  for (LocalId e = 0; e < mesh_.elements(); ++e) {
    const auto nodes = mesh_.nodes_of_element(e);
    if (std::any_of(nodes.begin(), nodes.end(), [&](LocalId n) { return active[static_cast<std::size_t>(n)] != 0; })) {
      active_elements_.push_back(e);
    }
  }
}

void LevelSetTransport::clip(std::span<Real> level_set) const {
  if (band_width_ == 0) return;
  for (Real& value : level_set) value = std::clamp(value, -band_width_, band_width_);
}

void LevelSetTransport::assemble(std::span<const Real> velocity, Real dt) {
  std::fill(left_.entries.begin(), left_.entries.end(), 0);
  std::fill(convection_.entries.begin(), convection_.entries.end(), 0);
  with_dim(mesh_.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    constexpr int n = (D + 1) * (D + 1);
    for (const LocalId e : active_elements_) {
      const auto p1 = p1_gradients<D>(simplex_points<D>(mesh_, e));
      const auto element = transport_element<D>(p1, velocities_of<D>(velocity, e), options_.stabilization, dt);
      const std::int32_t* slot = slots_.slots.data() + static_cast<std::size_t>(e) * n;
      for (int i = 0; i <= D; ++i) {
        for (int j = 0; j <= D; ++j, ++slot) {
          const auto at = static_cast<std::size_t>(*slot);
          left_.entries[at] += element.mass(i, j) + 0.5 * dt * element.convection(i, j);
          convection_.entries[at] += element.convection(i, j);
        }
      }
    }
  });
}

void LevelSetTransport::substep(std::span<Real> level_set, Real dt, Real share, const ImposedLevelSet& imposed,
                                TransportReport& report) {
  const auto n = static_cast<std::size_t>(mesh_.nodes());
  std::vector<Real> increment(n, 0);
  std::vector<char> is_imposed(n, 0);
  for (std::size_t i = 0; i < imposed.nodes.size(); ++i) {
    const auto node = static_cast<std::size_t>(imposed.nodes[i]);
    is_imposed[node] = 1;
    increment[node] = share * (imposed.values[i] - level_set[node]);
  }
  std::vector<LocalId> rows;
  rows.reserve(active_rows_.size());
  std::copy_if(active_rows_.begin(), active_rows_.end(), std::back_inserter(rows),
               [&](LocalId row) { return is_imposed[static_cast<std::size_t>(row)] == 0; });
  std::vector<Real> load(n, 0);
  multiply(mesh_, graph_, convection_, rows, level_set, load);
  for (Real& value : load) value *= -dt;
  const NodeSolution solution =
      solve_bicgstab(comm_, {mesh_, graph_, left_, rows}, load, increment, options_.tolerance);
  for (std::size_t node = 0; node < n; ++node) level_set[node] += increment[node];
  if (options_.narrow_band > 0) clip(level_set);
  ++report.substeps;
  report.iterations += solution.iterations;
  report.converged = report.converged && solution.converged;
}

}  // namespace malleus
