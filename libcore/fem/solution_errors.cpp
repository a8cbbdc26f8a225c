#include "fem/solution_errors.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "fem/quadrature.hpp"

namespace malleus {
namespace {

/// Elements at a time: enough to make a formula's call cheap, few enough to stay in cache.
constexpr LocalId chunk = 256;

/// Quadrature points of some elements: places and weights (volumes, ring volumes where axisymmetric).
template <int D>
struct PointSet {
  std::vector<QuadraturePoint<D>> rule;
  std::vector<Real> coordinates;  ///< [element][point][dim]
  std::vector<Real> weights;      ///< [element][point]
  std::vector<P1Gradients<D>> p1;

  explicit PointSet(int points_an_axis) : rule(simplex_quadrature<D>(points_an_axis)) {}
  std::size_t per_element() const { return rule.size(); }

  void fill(const Mesh& mesh, Geometry geometry, LocalId first, LocalId last) {
    coordinates.clear();
    weights.clear();
    p1.clear();
    for (LocalId e = first; e < last; ++e) {
      const SimplexPoints<D> points = simplex_points<D>(mesh, e);
      p1.push_back(p1_gradients<D>(points));
      for (const QuadraturePoint<D>& point : rule) {
        const Point<D> at = points * point.barycentric;
        coordinates.insert(coordinates.end(), at.data(), at.data() + D);
        const Real turn = geometry == Geometry::axisymmetric ? 2 * std::numbers::pi * at[0] : 1;
        weights.push_back(point.weight * p1.back().volume * turn);
      }
    }
  }
};

template <int D>
Eigen::Matrix<Real, D + 1, 1> nodal(const Mesh& mesh, std::span<const Real> field, LocalId element,
                                    std::size_t component, std::size_t components) {
  Eigen::Matrix<Real, D + 1, 1> values;
  const auto nodes = mesh.nodes_of_element(element);
  for (int i = 0; i <= D; ++i) {
    values[i] = field[static_cast<std::size_t>(nodes[static_cast<std::size_t>(i)]) * components + component];
  }
  return values;
}

/// Calls visit(set, element, its place in the set) for each element, chunk by chunk; prepare(set) before each chunk.
template <int D, class Prepare, class Visit>
void for_chunks(const Mesh& mesh, Geometry geometry, int points_an_axis, Prepare prepare, Visit visit) {
  PointSet<D> set(points_an_axis);
  for (LocalId first = 0; first < mesh.elements(); first += chunk) {
    const LocalId last = std::min(mesh.elements(), first + chunk);
    set.fill(mesh, geometry, first, last);
    prepare(set);
    for (LocalId e = first; e < last; ++e) visit(set, e, static_cast<std::size_t>(e - first));
  }
}

}  // namespace

ErrorNorms SolutionErrors::l2(std::span<const Real> field, std::span<const std::optional<KnownFunction>> known,
                              bool without_means) const {
  // Sums: weight, (f_h - f), f, (f_h - f)^2, f^2. Without means the squares lose weight times mean squared.
  std::array<Real, 5> sums = {};
  with_dim(mesh_.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (std::size_t c = 0; c < known.size(); ++c) {
      if (!known[c]) continue;
      std::vector<Real> exact;
      for_chunks<D>(
          mesh_, geometry_, 3,
          [&](const PointSet<D>& set) {
            exact.resize(set.weights.size());
            (*known[c])(set.coordinates, exact);
          },
          [&](const PointSet<D>& set, LocalId e, std::size_t place) {
            const auto values = nodal<D>(mesh_, field, e, c, known.size());
            for (std::size_t q = 0; q < set.per_element(); ++q) {
              const std::size_t at = place * set.per_element() + q;
              const Real difference = values.dot(set.rule[q].barycentric) - exact[at];
              const Real w = set.weights[at];
              const std::array<Real, 5> terms = {w, w * difference, w * exact[at], w * difference * difference,
                                                 w * exact[at] * exact[at]};
              for (std::size_t k = 0; k < terms.size(); ++k) sums[k] += terms[k];
            }
          });
    }
  });
  comm_.sum_in_place(sums);
  if (without_means && sums[0] > 0) {
    sums[3] -= sums[1] * sums[1] / sums[0];
    sums[4] -= sums[2] * sums[2] / sums[0];
  }
  return {std::sqrt(std::max(0.0, sums[3])), std::sqrt(std::max(0.0, sums[4]))};
}

ErrorNorms SolutionErrors::h1(std::span<const Real> field, std::span<const std::optional<KnownFunction>> known) const {
  std::array<Real, 2> sums = {};
  with_dim(mesh_.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (std::size_t c = 0; c < known.size(); ++c) {
      if (!known[c]) continue;
      std::array<std::vector<Real>, D> slope;
      const auto differentiate = [&](const PointSet<D>& set) {
        std::vector<Real> moved = set.coordinates;
        std::vector<Real> ahead(set.weights.size());
        std::vector<Real> behind(set.weights.size());
        const Real step = 1e-5 * std::pow(set.p1.front().volume, 1.0 / D);
        for (std::size_t axis = 0; axis < D; ++axis) {
          for (std::size_t at = axis; at < moved.size(); at += D) moved[at] = set.coordinates[at] + step;
          (*known[c])(moved, ahead);
          for (std::size_t at = axis; at < moved.size(); at += D) moved[at] = set.coordinates[at] - step;
          (*known[c])(moved, behind);
          for (std::size_t at = axis; at < moved.size(); at += D) moved[at] = set.coordinates[at];
          slope[axis].resize(ahead.size());
          for (std::size_t q = 0; q < ahead.size(); ++q) slope[axis][q] = (ahead[q] - behind[q]) / (2 * step);
        }
      };
      for_chunks<D>(mesh_, geometry_, 3, differentiate, [&](const PointSet<D>& set, LocalId e, std::size_t place) {
        const Point<D> gradient = set.p1[place].gradients * nodal<D>(mesh_, field, e, c, known.size());
        for (std::size_t q = 0; q < set.per_element(); ++q) {
          const std::size_t at = place * set.per_element() + q;
          for (int axis = 0; axis < D; ++axis) {
            const Real exact = slope[static_cast<std::size_t>(axis)][at];
            sums[0] += set.weights[at] * (gradient[axis] - exact) * (gradient[axis] - exact);
            sums[1] += set.weights[at] * exact * exact;
          }
        }
      });
    }
  });
  comm_.sum_in_place(sums);
  return {std::sqrt(sums[0]), std::sqrt(sums[1])};
}

ErrorNorms SolutionErrors::sign_mismatch(std::span<const Real> field, const KnownFunction& known) const {
  std::array<Real, 2> sums = {};
  with_dim(mesh_.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    std::vector<Real> exact;
    for_chunks<D>(
        mesh_, geometry_, 4,
        [&](const PointSet<D>& set) {
          exact.resize(set.weights.size());
          known(set.coordinates, exact);
        },
        [&](const PointSet<D>& set, LocalId e, std::size_t place) {
          const auto values = nodal<D>(mesh_, field, e, 0, 1);
          for (std::size_t q = 0; q < set.per_element(); ++q) {
            const std::size_t at = place * set.per_element() + q;
            const bool is_inside = values.dot(set.rule[q].barycentric) > 0;
            if (is_inside != (exact[at] > 0)) sums[0] += set.weights[at];
            if (exact[at] > 0) sums[1] += set.weights[at];
          }
        });
  });
  comm_.sum_in_place(sums);
  return {sums[0], sums[1]};
}

}  // namespace malleus
