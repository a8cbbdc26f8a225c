#include "inject/weld_lines.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace malleus::inject {
namespace {

constexpr Real least_angle = 30;  ///< degrees

}  // namespace

std::vector<Real> weld_angle(const Scene& scene, std::span<const Real> fill_time) {
  const Mesh& mesh = scene.mesh;
  const auto size = static_cast<std::size_t>(mesh.dim) + 2;
  std::vector<Real> sums(fill_time.size() * size, 0);  // unit gradients, how far they point to the node, volume
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto nodes = mesh.nodes_of_element(e);
      if (std::any_of(nodes.begin(), nodes.end(),
                      [&](LocalId n) { return fill_time[static_cast<std::size_t>(n)] < 0; }))
        continue;
      const SimplexPoints<D> points = simplex_points<D>(mesh, e);
      const auto shape = p1_gradients<D>(points);
      Point<D> gradient = Point<D>::Zero();
      for (int a = 0; a <= D; ++a)
        gradient += fill_time[static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)])] * shape.gradients.col(a);
      if (!(gradient.norm() > 0)) continue;
      gradient.normalize();
      const Point<D> middle = points.rowwise().mean();
      for (int a = 0; a <= D; ++a) {
        Real* sum = sums.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * size;
        Eigen::Map<Point<D>>(sum) += shape.volume * gradient;
        sum[D] += shape.volume * gradient.dot((points.col(a) - middle).normalized());
        sum[D + 1] += shape.volume;
      }
    }
  });
  mesh.node_halo.add_to_owners(sums, static_cast<int>(size));
  mesh.node_halo.update_copies(sums, static_cast<int>(size));
  std::vector<Real> angle(fill_time.size(), 0);
  for (std::size_t node = 0; node < angle.size(); ++node) {
    const Real* sum = sums.data() + node * size;
    const auto dim = static_cast<std::size_t>(mesh.dim);
    if (!(sum[dim + 1] > 0) || sum[dim] <= 0) continue;
    Real square = 0;
    for (std::size_t c = 0; c < dim; ++c) square += sum[c] * sum[c];
    const Real mean = std::min(1.0, std::sqrt(square) / sum[dim + 1]);
    const Real degrees = 360 / std::numbers::pi * std::acos(mean);
    if (degrees >= least_angle) angle[node] = degrees;
  }
  return angle;
}

}  // namespace malleus::inject
