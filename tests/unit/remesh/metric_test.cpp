#include "meshes.hpp"
#include "remesh/metric_tools.hpp"
#include "remesh/symmetric_tensor.hpp"
#include "remesh/vertex_metric.hpp"

namespace malleus {
namespace {

using namespace remeshing;
using test::box_mesh;

TEST(Metric, LogarithmAndExponentialAreInverse) {
  const Symmetric<3> m = {1e6, 2e3, 50, 300, 3, 20};
  const Symmetric<3> back = exponential<3>(logarithm<3>(m));
  for (std::size_t i = 0; i < m.size(); ++i) EXPECT_NEAR(back[i], m[i], 1e-9 * 1e6);
}

TEST(Metric, NormalizedExponentialIsTheExponentialUpToAFactor) {
  for (const Real stretch : {0.0, 1e-9, 0.3, 4.0, 13.8}) {
    const Symmetric<3> a = {stretch, 0.2 * stretch, -0.4, 0.1, 0.3 * stretch, 0.5};
    const Symmetric<3> e = exponential<3>(a);
    const Real factor = std::exp((a[0] + a[2] + a[5]) / 3);
    const Symmetric<3> n = normalized_exponential(a);
    for (std::size_t i = 0; i < n.size(); ++i) EXPECT_NEAR(n[i] * factor, e[i], 1e-6 * (e[0] + e[2] + e[5]));
    const Symmetric<2> a2 = {stretch, 0.7 * stretch, -1};
    const Symmetric<2> e2 = exponential<2>(a2);
    const Symmetric<2> n2 = normalized_exponential(a2);
    const Real factor2 = std::exp((a2[0] + a2[2]) / 2);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(n2[i] * factor2, e2[i], 1e-9 * (e2[0] + e2[2]));
  }
}

TEST(Metric, KeyOfTheRegularSimplexIsOneInAnyMetric) {
  const std::array<Point<3>, 4> x = {{{1, 1, 1}, {-1, 1, -1}, {1, -1, -1}, {-1, -1, 1}}};
  const SizeMetric<3> size = SizeMetric<3>::from_log({0});
  EXPECT_NEAR(shape_key<3>({&x[0], &x[1], &x[2], &x[3]}, {&size, &size, &size, &size}), 1, 1e-14);
  // The same after the map y = A x with the metric inv(A)^T inv(A), here A = diag(1, 100, 0.1).
  std::array<Point<3>, 4> y = x;
  for (auto& p : y) p = {p[0], 100 * p[1], 0.1 * p[2]};
  const Symmetric<3> m = {1, 0, 1e-4, 0, 0, 100};
  const auto metric = TensorMetric<3>::from_metric(m);
  EXPECT_NEAR(shape_key<3>({&y[0], &y[1], &y[2], &y[3]}, {&metric, &metric, &metric, &metric}), 1, 1e-6);
  EXPECT_EQ(shape_key<3>({&x[1], &x[0], &x[2], &x[3]}, {&size, &size, &size, &size}), -1);
}

TEST(Metric, GradationLimitsTheJumpOfSizes) {
  const RemeshMesh mesh = box_mesh(2, 10);
  std::vector<Real> sizes(static_cast<std::size_t>(mesh.nodes()), 1.0);
  sizes[0] = 0.01;
  Metric metric = Metric::per_node(std::move(sizes));
  limit_gradation(mesh, metric, 1.3);
  for (LocalId v = 0; v < mesh.nodes(); ++v) {
    const Real distance = std::hypot(mesh.point(v)[0], mesh.point(v)[1]);
    EXPECT_LE(metric.values()[static_cast<std::size_t>(v)], 0.01 + std::log(1.3) * 1.1 * distance * 1.01);
    EXPECT_GE(metric.values()[static_cast<std::size_t>(v)], 0.01 + std::log(1.3) * 0.99 * distance);
  }
}

TEST(Metric, GradationOfTensorsFollowsThatOfSizes) {
  const RemeshMesh mesh = box_mesh(3, 4);
  std::vector<Real> sizes(static_cast<std::size_t>(mesh.nodes()), 1.0);
  sizes[0] = 0.05;
  std::vector<Real> tensors;
  for (const Real h : sizes) tensors.insert(tensors.end(), {1 / (h * h), 0, 1 / (h * h), 0, 0, 1 / (h * h)});
  Metric scalar = Metric::per_node(std::move(sizes));
  Metric tensor = Metric::tensors(3, std::move(tensors));
  limit_gradation(mesh, scalar, 1.2);
  limit_gradation(mesh, tensor, 1.2);
  for (std::size_t v = 0; v < static_cast<std::size_t>(mesh.nodes()); ++v)
    EXPECT_NEAR(1 / std::sqrt(tensor.values()[6 * v]), scalar.values()[v], 0.01 * scalar.values()[v]);
}

TEST(Metric, IntersectionAsksForTheSmallerSizeInEachDirection) {
  const RemeshMesh mesh = box_mesh(2, 1);
  const Metric a = Metric::tensors(2, {100, 0, 1, 100, 0, 1, 100, 0, 1, 100, 0, 1});
  const Metric b = Metric::uniform(0.5);
  const Metric both = intersect(mesh, a, b);
  EXPECT_NEAR(both.values()[0], 100, 1e-10);
  EXPECT_NEAR(both.values()[1], 0, 1e-10);
  EXPECT_NEAR(both.values()[2], 4, 1e-10);
}

TEST(Metric, ScalesToAWantedNumberOfNodes) {
  for (const int dimension : {2, 3}) {
    RemeshMesh mesh = box_mesh(dimension, 6);
    std::vector<Real> sizes;
    for (LocalId v = 0; v < mesh.nodes(); ++v) sizes.push_back(1 + mesh.point(v)[0]);
    Metric metric = Metric::per_node(std::move(sizes));
    const Real wanted = 4000;
    scale_to_nodes(mesh, metric, wanted);
    remesh(mesh, metric);
    EXPECT_NEAR(mesh.nodes(), wanted, 0.3 * wanted);
  }
}

TEST(Metric, BoundsSizesAndTensors) {
  Metric sizes = Metric::per_node({0.1, 5});
  bound_sizes(sizes, 0.2, 1);
  EXPECT_EQ(sizes.values(), (std::vector<Real>{0.2, 1}));
  Metric tensor = Metric::tensors(2, {1e6, 0, 1e-6});
  bound_sizes(tensor, 0.1, 10);
  EXPECT_NEAR(tensor.values()[0], 100, 1e-9);
  EXPECT_NEAR(tensor.values()[2], 0.01, 1e-12);
}

}  // namespace
}  // namespace malleus
