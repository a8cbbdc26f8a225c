#include "fem/quadrature.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "base/error.hpp"

namespace malleus {

namespace {

struct LinePoint {
  Real place;  ///< in (0, 1)
  Real weight;
};

/// Gauss-Legendre on (0, 1): Newton on the Legendre polynomial by its three-term recurrence.
std::vector<LinePoint> gauss_legendre(int n) {
  std::vector<LinePoint> points;
  for (int i = 0; i < n; ++i) {
    Real x = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5));
    Real derivative = 1;
    for (int iteration = 0; iteration < 50; ++iteration) {
      Real previous = 1;
      Real value = x;
      for (int k = 2; k <= n; ++k) {
        const Real next = ((2 * k - 1) * x * value - (k - 1) * previous) / k;
        previous = value;
        value = next;
      }
      derivative = n * (x * value - previous) / (x * x - 1);
      const Real change = value / derivative;
      x -= change;
      if (std::abs(change) < 1e-15) break;
    }
    points.push_back({0.5 * (1 - x), 1 / ((1 - x * x) * derivative * derivative)});
  }
  return points;
}

}  // namespace

template <int D>
std::vector<QuadraturePoint<D>> simplex_quadrature(int n) {
  check(n >= 1 && n <= 8, "a quadrature has 1 to 8 points an axis");
  const std::vector<LinePoint> line = gauss_legendre(n);
  std::vector<QuadraturePoint<D>> points;
  std::array<int, 3> index{};
  const int count = D == 2 ? n * n : n * n * n;
  for (int k = 0; k < count; ++k) {
    index = {k % n, k / n % n, k / n / n};
    QuadraturePoint<D> point;
    Real rest = 1;  // what the axes so far leave of the barycentric sum
    point.weight = D == 2 ? 2 : 6;
    for (int d = 0; d < D; ++d) {
      const LinePoint& along = line[static_cast<std::size_t>(index[static_cast<std::size_t>(d)])];
      point.barycentric[d] = rest * along.place;
      point.weight *= along.weight * std::pow(1 - along.place, D - 1 - d);
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
