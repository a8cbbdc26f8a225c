#include "remesh/vertex_metric.hpp"

#include <algorithm>

#include "remesh/symmetric_tensor.hpp"

namespace malleus::remeshing {

template <int D>
TensorMetric<D> TensorMetric<D>::from_log(const Log& log) {
  return {log, exponential<D>(log)};
}

template <int D>
TensorMetric<D> TensorMetric<D>::from_metric(std::span<const Real> metric) {
  TensorMetric result;
  std::copy_n(metric.begin(), result.metric.size(), result.metric.begin());
  result.log = logarithm<D>(result.metric);
  return result;
}

template <int D>
Symmetric<D> TensorMetric<D>::inverse() const {
  return map_eigenvalues<D>(metric, [](Real value) { return 1 / value; });
}

template struct TensorMetric<2>;
template struct TensorMetric<3>;

Symmetric<2> normalized_exponential(Symmetric<2> a) {
  const Real mean = 0.5 * (a[0] + a[2]);
  const Real d = a[0] - mean;
  const Real r = std::sqrt(d * d + a[1] * a[1]);
  const Real grow = std::exp(r);
  const Real c = 0.5 * (grow + 1 / grow);
  const Real s = r > 1e-8 ? 0.5 * (grow - 1 / grow) / r : 1.0;
  return {c + s * d, s * a[1], c - s * d};
}

Symmetric<3> normalized_exponential(Symmetric<3> a) {
  const Real mean = (a[0] + a[2] + a[5]) / 3;
  a[0] -= mean;
  a[2] -= mean;
  a[5] -= mean;
  // Norm of A decides the number of squarings, so that the series below sees |A| <= 1/2.
  Real squares = a[0] * a[0] + a[2] * a[2] + a[5] * a[5] + 2 * (a[1] * a[1] + a[3] * a[3] + a[4] * a[4]);
  int squarings = 0;
  Real scale = 1;
  while (squares > 0.25 && squarings < 60) {
    squares *= 0.25;
    scale *= 0.5;
    ++squarings;
  }
  for (Real& value : a) value *= scale;
  const Symmetric<3> aa = {a[0] * a[0] + a[1] * a[1] + a[3] * a[3], a[0] * a[1] + a[1] * a[2] + a[3] * a[4],
                           a[1] * a[1] + a[2] * a[2] + a[4] * a[4], a[0] * a[3] + a[1] * a[4] + a[3] * a[5],
                           a[1] * a[3] + a[2] * a[4] + a[4] * a[5], a[3] * a[3] + a[4] * a[4] + a[5] * a[5]};
  const Real j2 = 0.5 * (aa[0] + aa[2] + aa[5]);  // A^3 = j2 A + j3 I for a traceless A
  const Real j3 =
      a[0] * (a[2] * a[5] - a[4] * a[4]) - a[1] * (a[1] * a[5] - a[4] * a[3]) + a[3] * (a[1] * a[4] - a[2] * a[3]);
  // Horner's rule for the series to order 9 in the basis I, A, A^2.
  Real x = 1;
  Real y = 0;
  Real z = 0;
  for (int n = 9; n >= 1; --n) {
    const Real inverse = 1.0 / n;
    const Real next_x = 1 + j3 * z * inverse;
    const Real next_y = (x + j2 * z) * inverse;
    z = y * inverse;
    x = next_x;
    y = next_y;
  }
  for (int n = 0; n < squarings; ++n) {
    const Real zz = z * z;
    const Real yz = 2 * y * z;
    const Real next_x = x * x + j3 * yz;
    const Real next_y = 2 * x * y + j2 * yz + j3 * zz;
    z = 2 * x * z + y * y + j2 * zz;
    x = next_x;
    y = next_y;
  }
  Symmetric<3> result;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = y * a[i] + z * aa[i];
  result[0] += x;
  result[2] += x;
  result[5] += x;
  return result;
}

}  // namespace malleus::remeshing
