#include "fem/boundary_conditions.hpp"

#include <algorithm>
#include <cmath>

#include "parallel/agreement.hpp"

namespace malleus {

namespace {

/// Share of the second moment of the normals above which a direction counts as faced: facets turned by +-20 degrees.
constexpr Real faced_share = 0.12;

/// Per node: sum of area normals [dim], of the angle-weighted second moment [dim*dim], of the weights.
constexpr int moment_size(int dim) {
  return dim + dim * dim + 1;
}

/// The angle of a facet at its node a (1 in 2D): weighs a flat fan of facets the same however it is cut.
template <int D>
Real facet_angle(const Eigen::Matrix<Real, D, D>& points, int a) {
  if constexpr (D == 2) {
    return 1;
  } else {
    const Point<3> u = points.col((a + 1) % 3) - points.col(a);
    const Point<3> v = points.col((a + 2) % 3) - points.col(a);
    return std::atan2(u.cross(v).norm(), u.dot(v));
  }
}

template <int D>
std::vector<Real> normal_moments(const Mesh& mesh, std::int32_t group, Geometry geometry) {
  std::vector<Real> moments(static_cast<std::size_t>(mesh.nodes()) * moment_size(D), 0.0);
  for (const LocalId facet : facets_of_group(mesh, group)) {
    const Eigen::Matrix<Real, D, D> points = facet_points<D>(mesh, facet);
    const FacetIntegrals<D> integrals = facet_integrals<D>(mesh, facet, geometry);
    if (!(facet_area_normal<D>(points).norm() > 0)) continue;
    const auto shares = integrals.shares();
    const auto nodes = mesh.nodes_of_facet(facet);
    for (int a = 0; a < D; ++a) {
      Real* place = moments.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * moment_size(D);
      const Real angle = facet_angle<D>(points, a);
      Eigen::Map<Point<D>>(place) += shares[a] * integrals.normal;
      Eigen::Map<Eigen::Matrix<Real, D, D>>(place + D) += angle * integrals.normal * integrals.normal.transpose();
      place[D + D * D] += angle;
    }
  }
  mesh.node_halo.add_to_owners(moments, moment_size(D));
  mesh.node_halo.update_copies(moments, moment_size(D));
  return moments;
}

Real finite_value(const Expression& expression, const Mesh& mesh, LocalId node, Real time) {
  std::array<Real, 3> point{};
  std::copy_n(mesh.point(node), mesh.dim, point.begin());
  return expression.finite_at(point, time);
}

void fix_components(const Mesh& mesh, const BoundaryCondition& condition, const GroupNormals& normals, Real time,
                    NodeConstraints& constraints) {
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (!normals.holds(node)) continue;
    for (std::size_t d = 0; d < static_cast<std::size_t>(mesh.dim); ++d) {
      if (!condition.velocity[d]) continue;
      std::array<Real, 3> axis{};
      std::array<Real, 3> velocity{};
      axis[d] = 1;
      velocity[d] = finite_value(*condition.velocity[d], mesh, node, time);
      constraints.fix_direction(node, axis.data(), velocity.data());
    }
  }
}

/// Fixes the directions orthogonal to the mean normal.
void fix_tangents(const Mesh& mesh, const GroupNormals& normals, NodeConstraints& constraints) {
  constexpr std::array<Real, 3> rest{};
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (!normals.holds(node)) continue;
    const auto normal = normals.normal(node);
    for (std::size_t d = 0; d < normal.size(); ++d) {
      std::array<Real, 3> tangent{};
      for (std::size_t k = 0; k < normal.size(); ++k) tangent[k] = (k == d ? 1 : 0) - normal[d] * normal[k];
      // of the projected axes those nearly along the normal are skipped; the others span the tangents
      const Real square = 1 - normal[d] * normal[d];
      if (square > 0.3) constraints.fix_direction(node, tangent.data(), rest.data());
    }
  }
}

void fix_normals(const Mesh& mesh, const GroupNormals& normals, NodeConstraints& constraints) {
  constexpr std::array<Real, 3> rest{};
  const auto dim = static_cast<std::size_t>(mesh.dim);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (!normals.holds(node)) continue;
    const auto directions = normals.directions(node);
    for (std::size_t k = 0; k < directions.size(); k += dim) {
      constraints.fix_direction(node, directions.data() + k, rest.data());
    }
  }
}

void fix_axis(const Mesh& mesh, NodeConstraints& constraints) {
  // Rounding of the mesh file's length unit puts nodes beside the axis; nothing smaller is meant by a radius.
  Real largest = 0;
  for (LocalId node = 0; node < mesh.nodes(); ++node) largest = std::max(largest, std::abs(mesh.point(node)[0]));
  constexpr std::array<Real, 3> radial = {1, 0, 0};
  constexpr std::array<Real, 3> rest{};
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    if (std::abs(mesh.point(node)[0]) <= 1e-10 * largest) constraints.fix_direction(node, radial.data(), rest.data());
  }
}

}  // namespace

GroupNormals::GroupNormals(const Mesh& mesh, std::int32_t group, Geometry geometry) : dim_(mesh.dim) {
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    const std::vector<Real> moments = normal_moments<D>(mesh, group, geometry);
    const auto nodes = static_cast<std::size_t>(mesh.nodes());
    rank_.assign(nodes, 0);
    frames_.assign(nodes * D * D, 0.0);
    normals_.assign(nodes * D, 0.0);
    for (std::size_t node = 0; node < nodes; ++node) {
      const Real* place = moments.data() + node * moment_size(D);
      const Real weight = place[D + D * D];
      if (!(weight > 0)) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<Real, D, D>> solver(
          Eigen::Map<const Eigen::Matrix<Real, D, D>>(place + D));
      Point<D> normal = Eigen::Map<const Point<D>>(place);
      // opposite faces of a thin sheet cancel in the mean, and on the axis the ring's area is zero
      if (!(normal.norm() > 0)) normal = solver.eigenvectors().col(D - 1);
      normal.normalize();
      Eigen::Map<Point<D>>(normals_.data() + node * D) = normal;
      std::int8_t count = 0;
      for (int k = D - 1; k >= 0; --k) {
        if (k < D - 1 && !(solver.eigenvalues()[k] > faced_share * weight)) break;
        Eigen::Map<Point<D>>(frames_.data() + node * D * D + count * D) = solver.eigenvectors().col(k);
        ++count;
      }
      if (count == 1) Eigen::Map<Point<D>>(frames_.data() + node * D * D) = normal;
      rank_[node] = count;
    }
  });
}

std::span<const Real> GroupNormals::directions(LocalId node) const {
  const auto i = static_cast<std::size_t>(node);
  const auto dim = static_cast<std::size_t>(dim_);
  return {frames_.data() + i * dim * dim, static_cast<std::size_t>(rank_[i]) * dim};
}

std::span<const Real> GroupNormals::normal(LocalId node) const {
  const auto dim = static_cast<std::size_t>(dim_);
  return {normals_.data() + static_cast<std::size_t>(node) * dim, dim};
}

NodeConstraints make_constraints(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                                 std::span<const BoundaryCondition> conditions, Real time) {
  NodeConstraints constraints(mesh.dim, mesh.nodes());
  std::vector<BoundaryCondition> ordered(conditions.begin(), conditions.end());
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const auto& a, const auto& b) { return static_cast<int>(a.kind) < static_cast<int>(b.kind); });
  constexpr std::array<Real, 3> rest{};
  for (const BoundaryCondition& condition : ordered) {
    const GroupNormals normals(mesh, condition.group, geometry);
    switch (condition.kind) {
      case ConditionKind::no_slip:
        for (LocalId node = 0; node < mesh.nodes(); ++node) {
          if (normals.holds(node)) constraints.fix_velocity(node, rest.data());
        }
        break;
      case ConditionKind::velocity:
        agree(comm, [&] { fix_components(mesh, condition, normals, time, constraints); });
        break;
      case ConditionKind::no_tangential:
        fix_tangents(mesh, normals, constraints);
        break;
      case ConditionKind::symmetry:
        fix_normals(mesh, normals, constraints);
        break;
    }
  }
  if (geometry == Geometry::axisymmetric) fix_axis(mesh, constraints);
  return constraints;
}

std::vector<FacetTraction> make_tractions(const Communicator& comm, const Mesh& mesh,
                                          std::span<const BoundaryLoad> loads, Real time) {
  std::vector<FacetTraction> tractions;
  agree(comm, [&] {
    with_dim(mesh.dim, [&](auto dimension) {
      constexpr int D = decltype(dimension)::value;
      for (const BoundaryLoad& load : loads) {
        for (const LocalId facet : facets_of_group(mesh, load.group)) {
          FacetTraction traction{facet, {}};
          const Point<D> normal = facet_area_normal<D>(facet_points<D>(mesh, facet)).normalized();
          const auto nodes = mesh.nodes_of_facet(facet);
          for (std::size_t a = 0; a < D; ++a) {
            const Real pressure = load.pressure ? finite_value(*load.pressure, mesh, nodes[a], time) : 0;
            for (std::size_t d = 0; d < D; ++d) {
              traction.traction[a * D + d] =
                  finite_value(load.traction[d], mesh, nodes[a], time) - pressure * normal[static_cast<int>(d)];
            }
          }
          tractions.push_back(traction);
        }
      }
    });
  });
  return tractions;
}

std::vector<LocalId> facets_of_group(const Mesh& mesh, std::int32_t group) {
  std::vector<LocalId> facets;
  for (LocalId facet = 0; facet < mesh.exterior_facets; ++facet) {
    if (mesh.facet_group[static_cast<std::size_t>(facet)] == group) facets.push_back(facet);
  }
  return facets;
}

Real boundary_area(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::span<const LocalId> facets) {
  Real area = 0;
  with_dim(mesh.dim, [&](auto d) {
    for (const LocalId facet : facets) area += facet_integrals<decltype(d)::value>(mesh, facet, geometry).area();
  });
  return comm.sum(area);
}

Real boundary_flux(const Communicator& comm, const Mesh& mesh, Geometry geometry, std::span<const LocalId> facets,
                   std::span<const Real> velocity, int stride) {
  Real flux = 0;
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId facet : facets) {
      const FacetIntegrals<D> integrals = facet_integrals<D>(mesh, facet, geometry);
      const auto shares = integrals.shares();
      const auto nodes = mesh.nodes_of_facet(facet);
      for (int a = 0; a < D; ++a) {
        const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]);
        const Eigen::Map<const Point<D>> v(velocity.data() + node * static_cast<std::size_t>(stride));
        flux += shares[a] * v.dot(integrals.normal);
      }
    }
  });
  return comm.sum(flux);
}

}  // namespace malleus
