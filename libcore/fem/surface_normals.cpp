#include "fem/surface_normals.hpp"

#include <algorithm>

namespace malleus {
namespace {

/// Two facets at an angle t between their normals, of equal area, give the tensor sum n n^T the eigenvalue ratio
/// tan^2(t/2): an edge counts as sharp from 40 degrees.
constexpr Real sharp_ratio = 0.13;

template <int D>
void set_directions(const Real* normal, const Real* tensor, Real* rows, int& count) {
  using Matrix = Eigen::Matrix<Real, D, D, Eigen::RowMajor>;
  const Matrix sum = Eigen::Map<const Matrix>(tensor);
  const Real trace = sum.trace();
  if (!(trace > 0)) return;
  Eigen::Map<Matrix> basis(rows);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<Real, D, D>> eigen{Eigen::Matrix<Real, D, D>(sum / trace)};
  Point<D> mean = Eigen::Map<const Point<D>>(normal);
  // Opposite faces of a thin part may cancel: then the tensor's own main direction.
  if (mean.norm() < 1e-3 * trace) mean = eigen.eigenvectors().col(D - 1);
  basis.row(0) = mean.normalized();
  count = 1;
  const Real largest = eigen.eigenvalues()[D - 1];
  for (int k = D - 1; k >= 0 && count < D; --k) {
    const bool is_needed = eigen.eigenvalues()[k] > sharp_ratio * largest;
    Point<D> direction = eigen.eigenvectors().col(k);
    for (int j = 0; j < count; ++j) direction -= basis.row(j).dot(direction) * basis.row(j).transpose();
    const bool is_new = direction.norm() > 0.3;
    if (is_needed && is_new) basis.row(count++) = direction.normalized();
  }
  // The rest completes the basis: the tangents.
  int filled = count;
  for (int axis = 0; axis < D && filled < D; ++axis) {
    int best = -1;
    Point<D> longest = Point<D>::Zero();
    for (int c = 0; c < D; ++c) {
      Point<D> candidate = Point<D>::Unit(c);
      for (int j = 0; j < filled; ++j) candidate -= basis.row(j).dot(candidate) * basis.row(j).transpose();
      if (best < 0 || candidate.norm() > longest.norm() + 1e-9) {
        best = c;
        longest = candidate;
      }
    }
    basis.row(filled++) = longest.normalized();
  }
}

}  // namespace

SurfaceNormals surface_normals(const Mesh& mesh, std::span<const LocalId> facets, Geometry geometry) {
  const auto n = static_cast<std::size_t>(mesh.nodes());
  SurfaceNormals result;
  result.dim = mesh.dim;
  result.count.assign(n, 0);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    result.weighted.assign(n * D, 0);
    result.directions.assign(n * D * D, 0);
    std::vector<Real> normals(n * D, 0);  // plain, for directions: on an axis the weighted ones vanish
    std::vector<Real> tensors(n * D * D, 0);
    for (const LocalId facet : facets) {
      const FacetIntegrals<D> integrals = facet_integrals<D>(mesh, facet, geometry);
      const Eigen::Matrix<Real, D, 1> shares = integrals.shares();
      const Real area = facet_area_normal<D>(facet_points<D>(mesh, facet)).norm();
      const Eigen::Matrix<Real, D, D, Eigen::RowMajor> tensor = area * integrals.normal * integrals.normal.transpose();
      for (int i = 0; i < D; ++i) {
        const auto node = static_cast<std::size_t>(mesh.nodes_of_facet(facet)[static_cast<std::size_t>(i)]);
        Eigen::Map<Point<D>>(result.weighted.data() + node * D) += shares[i] * integrals.normal;
        Eigen::Map<Point<D>>(normals.data() + node * D) += area * integrals.normal;
        Eigen::Map<Eigen::Matrix<Real, D, D, Eigen::RowMajor>>(tensors.data() + node * D * D) += tensor;
      }
    }
    for (auto* values : {&result.weighted, &normals, &tensors}) {
      const int components = values == &tensors ? D * D : D;
      mesh.node_halo.add_to_owners(*values, components);
      mesh.node_halo.update_copies(*values, components);
    }
    for (std::size_t node = 0; node < n; ++node) {
      set_directions<D>(normals.data() + node * D, tensors.data() + node * D * D,
                        result.directions.data() + node * D * D, result.count[node]);
    }
  });
  return result;
}

}  // namespace malleus
