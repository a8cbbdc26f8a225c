#include "solvers/level_set_speed.hpp"

#include <array>
#include <cmath>

#include "mesh/simplex.hpp"
#include "parallel/communicator.hpp"

namespace malleus {
namespace {

/// Whether the level set changes its sign in the element, or is zero at some node: the front may stand on a gate.
bool is_touched(const Mesh& mesh, LocalId element, std::span<const Real> level_set) {
  bool has_inside = false;
  bool has_outside = false;
  for (const LocalId node : mesh.nodes_of_element(element)) {
    has_inside = has_inside || level_set[static_cast<std::size_t>(node)] >= 0;
    has_outside = has_outside || level_set[static_cast<std::size_t>(node)] <= 0;
  }
  return has_inside && has_outside;
}

}  // namespace

std::vector<Real> node_sizes(const Mesh& mesh) {
  const auto n = static_cast<std::size_t>(mesh.nodes());
  std::vector<Real> sums(2 * n, 0);  // volume, elements
  with_dim(mesh.dim, [&](auto d) {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const Real volume = simplex_volume<d>(simplex_points<d>(mesh, e));
      for (const LocalId node : mesh.nodes_of_element(e)) {
        sums[2 * static_cast<std::size_t>(node)] += volume;
        sums[2 * static_cast<std::size_t>(node) + 1] += 1;
      }
    }
  });
  mesh.node_halo.add_to_owners(sums, 2);
  mesh.node_halo.update_copies(sums, 2);
  std::vector<Real> sizes(n, 0);
  for (std::size_t node = 0; node < n; ++node) {
    if (!(sums[2 * node + 1] > 0)) continue;
    const Real volume = sums[2 * node] / sums[2 * node + 1];
    sizes[node] = mesh.dim == 2 ? std::sqrt(4 / std::sqrt(3.0) * volume) : std::cbrt(6 * std::sqrt(2.0) * volume);
  }
  return sizes;
}

Real front_crossing_rate(const Communicator& comm, const Mesh& mesh, std::span<const Real> sizes,
                         std::span<const Real> velocity, std::span<const Real> level_set, int power) {
  std::array<Real, 2> sums = {0, 0};  // area times rate^power, area
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (!is_touched(mesh, e, level_set)) continue;
      const auto p1 = p1_gradients<D>(simplex_points<D>(mesh, e));
      Point<D> slope = Point<D>::Zero();
      Point<D> mean = Point<D>::Zero();
      Real size = 0;
      for (int i = 0; i <= D; ++i) {
        const auto node = static_cast<std::size_t>(mesh.nodes_of_element(e)[static_cast<std::size_t>(i)]);
        slope += level_set[node] * p1.gradients.col(i);
        mean += Eigen::Map<const Point<D>>(velocity.data() + node * D) / (D + 1);
        size += sizes[node] / (D + 1);
      }
      if (!(slope.norm() > 0)) continue;
      const Real area = p1.volume / size;
      sums[0] += area * std::pow(mean.dot(slope.normalized()) / size, power);
      sums[1] += area;
    }
  });
  comm.sum_in_place(sums);
  return sums[1] > 0 ? std::pow(sums[0] / sums[1], 1.0 / power) : 0;
}

}  // namespace malleus
