#include "fem/quadrature.hpp"

#include <array>
#include <cmath>

#include "base/error.hpp"

namespace malleus {

namespace {

struct LinePoint {
  Real place;   ///< u in (0, 1)
  Real weight;  ///< sum 1
};

/// Gauss-Jacobi on (0, 1) with weight (1-u)^power, by the eigenvalues of the recurrence (Golub, Welsch 1969).
std::vector<LinePoint> gauss_jacobi(int n, int power) {
  Eigen::MatrixXd recurrence = Eigen::MatrixXd::Zero(n, n);
  const Real a = power;
  for (int k = 0; k < n; ++k) {
    recurrence(k, k) = k == 0 ? -a / (a + 2) : -a * a / ((2 * k + a) * (2 * k + a + 2));
    if (k == 0) continue;
    const Real sum = 2 * k + a;
    recurrence(k, k - 1) = recurrence(k - 1, k) = 2 * k * (k + a) / (sum * std::sqrt((sum + 1) * (sum - 1)));
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(recurrence);
  std::vector<LinePoint> points;
  for (int k = 0; k < n; ++k) {
    const Real first = solver.eigenvectors()(0, k);
    points.push_back({0.5 * (1 + solver.eigenvalues()[k]), first * first});
  }
  return points;
}

}  // namespace

template <int D>
std::vector<QuadraturePoint<D>> simplex_quadrature(int n) {
  check(n >= 1 && n <= 8, "a quadrature has 1 to 8 points an axis");
  std::array<std::vector<LinePoint>, D> lines;
  for (int d = 0; d < D; ++d) lines[static_cast<std::size_t>(d)] = gauss_jacobi(n, D - 1 - d);
  std::vector<QuadraturePoint<D>> points;
  const int count = D == 2 ? n * n : n * n * n;
  for (int k = 0; k < count; ++k) {
    const std::array<int, 3> index = {k % n, k / n % n, k / n / n};
    QuadraturePoint<D> point;
    point.weight = 1;
    Real rest = 1;  // what the axes so far leave of the barycentric sum
    for (std::size_t d = 0; d < D; ++d) {
      const LinePoint& along = lines[d][static_cast<std::size_t>(index[d])];
      point.barycentric[static_cast<int>(d)] = rest * along.place;
      point.weight *= along.weight;
      rest *= 1 - along.place;
    }
    point.barycentric[D] = rest;
    points.push_back(point);
  }
  return points;
}

template std::vector<QuadraturePoint<2>> simplex_quadrature<2>(int);
template std::vector<QuadraturePoint<3>> simplex_quadrature<3>(int);

}  // namespace malleus
