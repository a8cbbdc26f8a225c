#include "fem/error_norms.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "fem/quadrature.hpp"
#include "parallel/agreement.hpp"

namespace malleus {

namespace {

template <int D>
using Weights = Eigen::Matrix<Real, D + 1, 1>;

Real value_at(const Expression& expression, const Real* point, int dim, Real time) {
  std::array<Real, 3> place{};
  std::copy_n(point, dim, place.begin());
  return expression.finite_at(place, time);
}

/// Values of a nodal field at an element's vertices, a column a vertex.
template <int D, int Components>
Eigen::Matrix<Real, Components, D + 1> vertex_values(const Mesh& mesh, LocalId element, std::span<const Real> field) {
  Eigen::Matrix<Real, Components, D + 1> values;
  const auto nodes = mesh.nodes_of_element(element);
  for (int a = 0; a <= D; ++a) {
    const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]);
    values.col(a) = Eigen::Map<const Eigen::Matrix<Real, Components, 1>>(field.data() + node * Components);
  }
  return values;
}

/// Sums over the elements of this rank.
template <int D>
class ErrorSums {
 public:
  ErrorSums(const Mesh& mesh, Geometry geometry, const KnownSolution& known, const DiscreteFields& fields, Real time)
      : mesh_(mesh), geometry_(geometry), known_(known), fields_(fields), time_(time) {}

  /// [error, known] of each norm; the pressure: sums of the error, its square, of p_known, its square, the volume.
  std::array<Real, 2> velocity{}, gradient{}, level_set{};
  std::array<Real, 5> pressure{};

  void add(LocalId element) {
    points_ = simplex_points<D>(mesh_, element);
    geometry_of_ = p1_gradients<D>(points_);
    if (known_.velocity[0] && !fields_.velocity.empty()) add_velocity(element);
    if (known_.pressure && !fields_.pressure.empty()) add_pressure(element);
    if (known_.level_set && !fields_.level_set.empty()) add_level_set(element);
  }

 private:
  Real weight_at(const Point<D>& point, Real share) const {
    const Real ring = geometry_ == Geometry::axisymmetric ? 2 * std::numbers::pi * point[0] : 1;
    return share * geometry_of_.volume * ring;
  }
  Point<D> known_velocity(const Point<D>& point) const {
    Point<D> value;
    for (int d = 0; d < D; ++d)
      value[d] = value_at(*known_.velocity[static_cast<std::size_t>(d)], point.data(), D, time_);
    return value;
  }
  void add_velocity(LocalId element);
  void add_pressure(LocalId element);
  void add_level_set(LocalId element);

  const Mesh& mesh_;
  Geometry geometry_;
  const KnownSolution& known_;
  const DiscreteFields& fields_;
  Real time_;
  SimplexPoints<D> points_;
  P1Gradients<D> geometry_of_;
  std::vector<QuadraturePoint<D>> fine_ = simplex_quadrature<D>(3);
  std::vector<QuadraturePoint<D>> coarse_ = simplex_quadrature<D>(2);
  std::vector<QuadraturePoint<D>> dense_ = simplex_quadrature<D>(D == 2 ? 8 : 4);
};

template <int D>
void ErrorSums<D>::add_velocity(LocalId element) {
  const Eigen::Matrix<Real, D, D + 1> values = vertex_values<D, D>(mesh_, element, fields_.velocity);
  for (const auto& [phi, share] : fine_) {
    const Point<D> point = points_ * phi;
    const Real weight = weight_at(point, share);
    const Point<D> exact = known_velocity(point);
    velocity[0] += weight * (values * phi - exact).squaredNorm();
    velocity[1] += weight * exact.squaredNorm();
  }
  const Eigen::Matrix<Real, D, D> slope = values * geometry_of_.gradients.transpose();
  const Real step = 1e-3 * std::pow(geometry_of_.volume, 1.0 / D);
  for (const auto& [phi, share] : coarse_) {
    const Point<D> point = points_ * phi;
    Eigen::Matrix<Real, D, D> exact;
    for (int d = 0; d < D; ++d) {
      const Point<D> shift = step * Point<D>::Unit(d);
      exact.col(d) = (known_velocity(point + shift) - known_velocity(point - shift)) / (2 * step);
    }
    const Real weight = weight_at(point, share);
    gradient[0] += weight * (slope - exact).squaredNorm();
    gradient[1] += weight * exact.squaredNorm();
    if (geometry_ != Geometry::axisymmetric) continue;
    const Real known_hoop = known_velocity(point)[0] / point[0];
    const Real hoop = values.row(0).dot(phi) / point[0];
    gradient[0] += weight * (hoop - known_hoop) * (hoop - known_hoop);
    gradient[1] += weight * known_hoop * known_hoop;
  }
}

template <int D>
void ErrorSums<D>::add_pressure(LocalId element) {
  const Eigen::Matrix<Real, 1, D + 1> values = vertex_values<D, 1>(mesh_, element, fields_.pressure);
  for (const auto& [phi, share] : fine_) {
    const Point<D> point = points_ * phi;
    const Real weight = weight_at(point, share);
    const Real exact = value_at(*known_.pressure, point.data(), D, time_);
    const Real error = values.dot(phi) - exact;
    pressure[0] += weight * error;
    pressure[1] += weight * error * error;
    pressure[2] += weight * exact;
    pressure[3] += weight * exact * exact;
    pressure[4] += weight;
  }
}

template <int D>
void ErrorSums<D>::add_level_set(LocalId element) {
  const Eigen::Matrix<Real, 1, D + 1> values = vertex_values<D, 1>(mesh_, element, fields_.level_set);
  int inside = 0;
  for (int a = 0; a <= D; ++a) {
    inside += values[a] > 0 ? 1 : 0;
    inside += value_at(*known_.level_set, points_.col(a).data(), D, time_) > 0 ? 1 : 0;
  }
  // all vertices of both agree: the centroid tells a front that passes between the vertices
  const Point<D> centroid = points_.rowwise().mean();
  const bool exact_inside = value_at(*known_.level_set, centroid.data(), D, time_) > 0;
  const bool plain = (inside == 0 && !exact_inside) || (inside == 2 * (D + 1) && exact_inside);
  for (const auto& [phi, share] : plain ? coarse_ : dense_) {
    const Point<D> point = points_ * phi;
    const Real weight = weight_at(point, share);
    const bool exact = plain ? exact_inside : value_at(*known_.level_set, point.data(), D, time_) > 0;
    if (exact) level_set[1] += weight;
    if (!plain && exact != (values.dot(phi) > 0)) level_set[0] += weight;
  }
}

ErrorNorm root(const std::array<Real, 2>& squares) {
  return {std::sqrt(squares[0]), std::sqrt(squares[1])};
}

ErrorNorm pressure_norm(const std::array<Real, 5>& sums, bool is_free) {
  const Real volume = sums[4];
  const Real error_mean = is_free && volume > 0 ? sums[0] * sums[0] / volume : 0;
  const Real known_mean = is_free && volume > 0 ? sums[2] * sums[2] / volume : 0;
  return {std::sqrt(std::max<Real>(0, sums[1] - error_mean)), std::sqrt(std::max<Real>(0, sums[3] - known_mean))};
}

}  // namespace

Real ErrorNorm::relative() const {
  return known > 0 ? absolute / known : std::numeric_limits<Real>::quiet_NaN();
}

SolutionErrors solution_errors(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                               const KnownSolution& known, const DiscreteFields& fields, std::span<const Real> modelled,
                               Real time) {
  SolutionErrors errors;
  with_dim(mesh.dim, [&](auto d) {
    ErrorSums<decltype(d)::value> sums(mesh, geometry, known, fields, time);
    agree(comm, [&] {
      for (LocalId e = 0; e < mesh.elements(); ++e) {
        if (modelled.empty() || modelled[static_cast<std::size_t>(e)] > 0) sums.add(e);
      }
    });
    comm.sum_in_place(sums.velocity);
    comm.sum_in_place(sums.gradient);
    comm.sum_in_place(sums.pressure);
    comm.sum_in_place(sums.level_set);
    if (known.velocity[0] && !fields.velocity.empty()) {
      errors.velocity_l2 = root(sums.velocity);
      errors.velocity_h1 = root(sums.gradient);
    }
    if (known.pressure && !fields.pressure.empty()) {
      errors.pressure_l2 = pressure_norm(sums.pressure, fields.pressure_is_free);
    }
    if (known.level_set && !fields.level_set.empty()) {
      errors.level_set_l1 = ErrorNorm{sums.level_set[0], sums.level_set[1]};
    }
  });
  return errors;
}

}  // namespace malleus
