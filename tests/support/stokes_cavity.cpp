#include "support/stokes_cavity.hpp"

#include <algorithm>
#include <cmath>

namespace malleus::test {
namespace {

constexpr Real on_wall = 1e-9;

bool is_inside(const Sphere& sphere, const Real* point, int dim) {
  Real square = 0;
  for (int d = 0; d < dim; ++d) {
    const Real offset = point[d] - sphere.center[static_cast<std::size_t>(d)];
    square += offset * offset;
  }
  return square < sphere.radius * sphere.radius;
}

Real lid_speed(const Real* x, int dim) {
  return dim == 3 ? 16 * x[0] * (1 - x[0]) * x[1] * (1 - x[1]) : 4 * x[0] * (1 - x[0]);
}

/// Nodes held along a direction each by a stiffness: contacts with a tool that have closed.
class HeldNodes final : public ResidualTerm {
 public:
  HeldNodes(const Mesh& mesh, std::vector<LocalId> nodes, Real stiffness)
      : mesh_(mesh), nodes_(std::move(nodes)), stiffness_(stiffness) {}

  void add_residual(const NodeSpace&, std::span<const Real> unknowns, std::span<Real> force) const override {
    const int dim = mesh_.dim;
    for (const LocalId node : nodes_) {
      const Real* velocity = unknowns.data() + static_cast<std::size_t>(node) * static_cast<std::size_t>(dim + 1);
      const std::array<Real, 3> normal = normal_at(node);
      Real speed = 0;
      for (int d = 0; d < dim; ++d) speed += velocity[d] * normal[static_cast<std::size_t>(d)];
      for (int d = 0; d < dim; ++d) {
        force[static_cast<std::size_t>(node * dim + d)] += stiffness_ * speed * normal[static_cast<std::size_t>(d)];
      }
    }
  }

  void add_tangent(const NodeSpace&, std::span<const Real>, TangentSink& sink) const override {
    const auto dim = static_cast<std::size_t>(mesh_.dim);
    for (const LocalId node : nodes_) {
      const std::array<Real, 3> normal = normal_at(node);
      std::array<Real, 9> block{};
      for (std::size_t i = 0; i < dim; ++i) {
        for (std::size_t j = 0; j < dim; ++j) block[i * dim + j] = stiffness_ * normal[i] * normal[j];
      }
      sink.add(node, node, block.data());
    }
  }

  bool is_linear() const override { return true; }

 private:
  /// Tilted from x by up to a fifth, differently at each node.
  std::array<Real, 3> normal_at(LocalId node) const {
    const Real* x = mesh_.point(node);
    std::array<Real, 3> normal = {1, 0.2 * std::sin(91 * x[1]), mesh_.dim == 3 ? 0.2 * std::cos(77 * x[2]) : 0};
    const Real length = std::hypot(normal[0], normal[1], normal[2]);
    for (Real& value : normal) value /= length;
    return normal;
  }

  const Mesh& mesh_;
  std::vector<LocalId> nodes_;
  Real stiffness_;
};

NodeConstraints wall_constraints(const Mesh& mesh, bool is_open) {
  NodeConstraints constraints(mesh.dim, mesh.nodes());
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real* x = mesh.point(node);
    bool is_on_wall = false;
    for (int d = is_open ? mesh.dim - 1 : 0; d < mesh.dim; ++d) {
      is_on_wall = is_on_wall || x[d] < on_wall || x[d] > 1 - on_wall;
    }
    if (!is_on_wall) continue;
    std::array<Real, 3> velocity{};
    const bool is_lid = x[mesh.dim - 1] > 1 - on_wall;
    if (is_lid && is_open) velocity[static_cast<std::size_t>(mesh.dim - 1)] = -1;
    if (is_lid && !is_open) velocity[0] = lid_speed(x, mesh.dim);
    constraints.fix_velocity(node, velocity.data());
  }
  return constraints;
}

}  // namespace

LinearVector right_side_of(StokesOperator& equations, const StokesState& state) {
  LinearVector right_side;
  equations.residual(state, right_side);
  for (Real& value : right_side.nodes) value = -value;
  for (Real& value : right_side.borders) value = -value;
  return right_side;
}

std::vector<Sphere> spread_spheres(int count, bool disjoint) {
  std::uint32_t state = 12345;
  const auto next = [&] {
    state = state * 1664525U + 1013904223U;
    return static_cast<Real>(state >> 8) / 16777216.0;
  };
  // Apart from each other no more than some eight of full size have room.
  const Real share = disjoint && count > 8 ? std::cbrt(8.0 / count) : 1;
  std::vector<Sphere> spheres;
  while (static_cast<int>(spheres.size()) < count) {
    Sphere sphere;
    for (Real& x : sphere.center) x = 0.15 + 0.7 * next();
    sphere.radius = share * (0.05 + 0.08 * next());
    bool is_apart = true;
    for (const Sphere& other : spheres) {
      Real square = 0;
      for (std::size_t d = 0; d < 3; ++d) square += std::pow(sphere.center[d] - other.center[d], 2);
      is_apart = is_apart && std::sqrt(square) > sphere.radius + other.radius + 0.07 * share;
    }
    if (is_apart || !disjoint) spheres.push_back(sphere);
  }
  return spheres;
}

StokesCavity::StokesCavity(const Communicator& comm, const CavityOptions& options)
    : mesh_(box_mesh(comm, options.box)) {
  const int dim = mesh_.dim;
  std::vector<Real> viscosity(static_cast<std::size_t>(mesh_.elements()), options.viscosity_scale);
  StokesLoads loads;
  loads.element_force.assign(viscosity.size() * static_cast<std::size_t>(dim), 0.0);
  for (LocalId element = 0; element < mesh_.elements(); ++element) {
    std::array<Real, 3> center{};
    for (const LocalId node : mesh_.nodes_of_element(element)) {
      for (int d = 0; d < dim; ++d) center[static_cast<std::size_t>(d)] += mesh_.point(node)[d] / (dim + 1);
    }
    const bool is_in_sphere = std::any_of(options.spheres.begin(), options.spheres.end(),
                                          [&](const Sphere& sphere) { return is_inside(sphere, center.data(), dim); });
    if (is_in_sphere) viscosity[static_cast<std::size_t>(element)] *= options.inside;
    if (is_in_sphere == (options.inside >= 1)) {
      loads.element_force[static_cast<std::size_t>((element + 1) * dim - 1)] = -10 * options.viscosity_scale;
    }
  }
  model_ = std::make_unique<GivenViscosity>(std::move(viscosity));
  equations_ = std::make_unique<StokesOperator>(comm, mesh_, Geometry::plane);
  equations_->set_viscosity(*model_);
  equations_->use_matrix_free(options.matrix_free);
  if (options.penalty > 0) add_penalties(options.penalty, options.viscosity_scale);
  equations_->set_constraints(options.is_floating ? NodeConstraints(dim, mesh_.nodes())
                                                  : wall_constraints(mesh_, options.is_open));
  equations_->set_loads(std::move(loads));
  for (LocalId node = 0; node < mesh_.nodes(); ++node) {
    mesh_.coordinates[static_cast<std::size_t>((node + 1) * dim - 1)] /= options.aspect;
  }
  equations_->prepare();
  StokesState state = equations_->start_state();
  equations_->update_viscosity(state);
  right_side_ = right_side_of(*equations_, state);
  system_ = &equations_->tangent(state, Tangent::picard);
}

void StokesCavity::add_penalties(Real penalty, Real viscosity) {
  std::vector<LocalId> held;
  for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
    const Real* x = mesh_.point(node);
    const bool is_on_patch =
        x[0] > 1 - on_wall && x[1] > 0.2 && x[1] < 0.8 && (mesh_.dim == 2 || std::abs(x[2] - 0.5) < 0.3);
    if (is_on_patch) held.push_back(node);
  }
  const Real edge = std::pow(static_cast<Real>(mesh_.total_nodes()), -1.0 / mesh_.dim);
  contacts_ = std::make_unique<HeldNodes>(mesh_, std::move(held), penalty * viscosity * std::pow(edge, mesh_.dim - 2));
  equations_->set_terms({contacts_.get()});
}

}  // namespace malleus::test
