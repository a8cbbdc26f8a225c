#include "fem/matrix_free_tangent.hpp"

#include <algorithm>

#include "fem/element_loop.hpp"
#include "parallel/petsc_shell.hpp"

namespace malleus {

MatrixFreeTangent::MatrixFreeTangent(const Communicator& comm, const Mesh& mesh, const NodeConstraints& constraints,
                                     MatrixFreeCoefficients coefficients)
    : mesh_(mesh), constraints_(constraints), coefficients_(std::move(coefficients)) {
  const int size = mesh.dim + 1;
  in_.resize(static_cast<std::size_t>(mesh.nodes()) * static_cast<std::size_t>(size));
  out_.resize(in_.size());
  shell_ = PetscOwner<Mat, MatDestroy>(make_shell_matrix(comm.raw(), mesh.owned_nodes() * size, *this));
}

template <int D>
void MatrixFreeTangent::add_elements() {
  const MatrixFreeCoefficients& c = coefficients_;
  for (LocalId e = 0; e < mesh_.elements(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (!(c.viscosity[i] > 0)) continue;
    const MiniElement<D> element(simplex_points<D>(mesh_, e));
    const ElementUnknowns<D> step = gather<D>(mesh_, e, in_);
    ElementUnknowns<D> product = element.residual(step, c.viscosity[i], c.viscosity[i]);
    if (!c.slope.empty() && c.slope[i] != 0) {
      Point<D> force = Point<D>::Zero();
      if (!c.force.empty()) force = Eigen::Map<const Point<D>>(c.force.data() + i * D);
      const ElementUnknowns<D> state = gather<D>(mesh_, e, c.state);
      element.add_slope_product(step, {state, force, c.viscosity[i], c.slope[i], c.follows_subscales}, product);
    }
    scatter<D>(mesh_, e, product, 1, out_);
  }
}

void MatrixFreeTangent::multiply(const Real* x, Real* y) {
  const auto size = static_cast<std::size_t>(mesh_.dim) + 1;
  const auto owned = static_cast<std::size_t>(mesh_.owned_nodes());
  std::copy_n(x, owned * size, in_.begin());
  for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
    Real* values = in_.data() + static_cast<std::size_t>(node) * size;
    constraints_.project(node, values);
    values[size - 1] *= constraints_.is_pressure_fixed(node) ? 0 : coefficients_.pressure_scale;
  }
  mesh_.node_halo.update_copies(in_, static_cast<int>(size));
  std::fill(out_.begin(), out_.end(), 0.0);
  with_dim(mesh_.dim, [&](auto d) { add_elements<decltype(d)::value>(); });
  mesh_.node_halo.add_to_owners(out_, static_cast<int>(size));
  for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
    const std::size_t first = static_cast<std::size_t>(node) * size;
    Real* sums = out_.data() + first;
    constraints_.project(node, sums);
    for (std::size_t d = 0; d + 1 < size; ++d) {
      y[first + d] = sums[d] + coefficients_.fixed_stiffness * (x[first + d] - in_[first + d]);
    }
    const std::size_t last = first + size - 1;
    y[last] = constraints_.is_pressure_fixed(node) ? -coefficients_.fixed_stiffness * x[last]
                                                   : coefficients_.pressure_scale * out_[last];
  }
}

}  // namespace malleus
