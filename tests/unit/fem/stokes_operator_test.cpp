#include "fem/stokes_operator.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fem/boundary_conditions.hpp"
#include "support/box_mesh.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::box_mesh;
using test::world;

/// Springs between nodes that share no element: force k |d|^2 d, d the difference of their velocities. The rank that
/// owns the first node of a spring adds it.
class Springs final : public ResidualTerm {
 public:
  explicit Springs(const Mesh& mesh) : dim_(mesh.dim) {
    for (GlobalId node = 0; node < mesh.total_nodes(); node += 3) {
      if (mesh.node_ownership.owns(node)) pairs_.push_back({node, (node * 7 + 5) % mesh.total_nodes()});
    }
  }
  void extra_couplings(NodeTuples& tuples) const override {
    for (const auto& pair : pairs_) tuples.add(pair);
  }
  void add_residual(const NodeSpace& space, std::span<const Real> unknowns, std::span<Real> force) const override {
    for (const auto& pair : pairs_) {
      const auto [a, b] = locals(space, pair);
      const Eigen::Vector3d d = stretch(unknowns, a, b);
      for (int i = 0; i < dim_; ++i) {
        force[static_cast<std::size_t>(a * dim_ + i)] += stiffness * d.squaredNorm() * d[i];
        force[static_cast<std::size_t>(b * dim_ + i)] -= stiffness * d.squaredNorm() * d[i];
      }
    }
  }
  void add_tangent(const NodeSpace& space, std::span<const Real> unknowns, TangentSink& sink) const override {
    for (const auto& pair : pairs_) {
      const auto [a, b] = locals(space, pair);
      const Eigen::Vector3d d = stretch(unknowns, a, b);
      std::array<Real, 9> block{};
      std::array<Real, 9> opposite{};
      for (int i = 0; i < dim_; ++i) {
        for (int j = 0; j < dim_; ++j) {
          const auto k = static_cast<std::size_t>(i * dim_ + j);
          block[k] = stiffness * ((i == j ? d.squaredNorm() : 0) + 2 * d[i] * d[j]);
          opposite[k] = -block[k];
        }
      }
      sink.add(a, a, block.data());
      sink.add(b, b, block.data());
      sink.add(a, b, opposite.data());
      sink.add(b, a, opposite.data());
    }
  }

 private:
  using Pair = std::array<GlobalId, 2>;
  static constexpr Real stiffness = 0.3;

  static std::array<LocalId, 2> locals(const NodeSpace& space, const Pair& pair) {
    return {space.local_node(pair[0]), space.local_node(pair[1])};
  }
  Eigen::Vector3d stretch(std::span<const Real> unknowns, LocalId a, LocalId b) const {
    Eigen::Vector3d d = Eigen::Vector3d::Zero();
    for (int i = 0; i < dim_; ++i) {
      d[i] = unknowns[static_cast<std::size_t>(a * (dim_ + 1) + i)] -
             unknowns[static_cast<std::size_t>(b * (dim_ + 1) + i)];
    }
    return d;
  }

  int dim_;
  std::vector<Pair> pairs_;
};

/// A law that thins, on a box of which x_low is held, y_low is a plane of symmetry and x_high a gate.
struct Scene {
  Scene(const Communicator& comm, int dim, Geometry geometry)
      : mesh(box_mesh(comm, {.dim = dim, .cells = {3, 4, 5}, .jitter = 0.2})), op(comm, mesh, geometry), springs(mesh) {
    std::vector<std::unique_ptr<const ViscousLaw>> laws;
    laws.push_back(std::make_unique<NortonHoffLaw>(NortonHoff{2, 0.4, 0.1}));
    model = std::make_unique<RegionViscosity>(std::move(laws));
    op.set_viscosity(*model);
    std::vector<BoundaryCondition> conditions(2);
    conditions[0].group = mesh.find_group("x_low");
    conditions[1] = {mesh.find_group("y_low"), ConditionKind::symmetry, {}};
    op.set_constraints(make_constraints(comm, mesh, geometry, conditions, 0));
    op.set_gates({{facets_of_group(mesh, mesh.find_group("x_high")), 0.7}});
    op.set_terms({&springs});
    StokesLoads loads;
    loads.element_force.assign(static_cast<std::size_t>(mesh.elements()) * static_cast<std::size_t>(dim), 0.8);
    op.set_loads(std::move(loads));
    op.prepare();
  }

  /// A state of smooth velocities and pressures.
  StokesState some_state() const {
    StokesState state = op.start_state();
    const auto dim = static_cast<std::size_t>(mesh.dim);
    for (LocalId node = 0; node < mesh.nodes(); ++node) {
      const Real* x = mesh.point(node);
      Real* v = state.nodes.data() + static_cast<std::size_t>(node) * (dim + 1);
      for (std::size_t d = 0; d < dim; ++d) v[d] = std::sin(3 * x[0] + 2 * x[1] + static_cast<Real>(d)) * (1 + x[d]);
      v[dim] = std::cos(2 * x[0] - x[1]);
    }
    op.impose_constraints(state);
    state.borders[0] = 0.2;
    return state;
  }

  Mesh mesh;
  std::unique_ptr<RegionViscosity> model;
  StokesOperator op;
  Springs springs;
};

LinearVector residual_at(StokesOperator& op, const StokesState& state) {
  LinearVector result;
  op.update_viscosity(state);
  op.residual(state, result);
  return result;
}

/// [K g; g^T 0] x on owned unknowns.
LinearVector multiply(const LinearSystem& system, const LinearVector& x) {
  Vec in = nullptr;
  Vec out = nullptr;
  MatCreateVecs(system.matrix, &in, &out);
  Real* values = nullptr;
  VecGetArray(in, &values);
  std::copy(x.nodes.begin(), x.nodes.end(), values);
  VecRestoreArray(in, &values);
  MatMult(system.matrix, in, out);
  const Real* products = nullptr;
  VecGetArrayRead(out, &products);
  LinearVector y;
  y.nodes.assign(products, products + x.nodes.size());
  VecRestoreArrayRead(out, &products);
  VecDestroy(&in);
  VecDestroy(&out);
  const auto dim = static_cast<std::size_t>(system.mesh->dim);
  for (std::size_t b = 0; b < system.borders.size(); ++b) {
    const BorderColumn& column = system.borders[b];
    Real sum = 0;
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      const std::size_t first = static_cast<std::size_t>(column.nodes[k]) * (dim + 1);
      for (std::size_t d = 0; d < dim; ++d) {
        y.nodes[first + d] += column.values[k * dim + d] * x.borders[b];
        sum += column.values[k * dim + d] * x.nodes[first + d];
      }
    }
    y.borders.push_back(world().sum(sum));
  }
  return y;
}

/// A direction of smooth changes within the free directions.
LinearVector some_direction(const Scene& scene, Real phase) {
  LinearVector x;
  const int dim = scene.mesh.dim;
  for (LocalId node = 0; node < scene.mesh.owned_nodes(); ++node) {
    const Real* place = scene.mesh.point(node);
    std::array<Real, 4> values{};
    for (int d = 0; d <= dim; ++d) {
      values[static_cast<std::size_t>(d)] = std::cos(4 * place[0] - 3 * place[1] + phase * d);
    }
    scene.op.constraints().project(node, values.data());
    x.nodes.insert(x.nodes.end(), values.begin(), values.begin() + dim + 1);
  }
  x.borders = {phase};
  return x;
}

Real dot(const LinearVector& a, const LinearVector& b) {
  Real sum = 0;
  for (std::size_t i = 0; i < a.nodes.size(); ++i) sum += a.nodes[i] * b.nodes[i];
  return world().sum(sum) + a.borders[0] * b.borders[0];
}

class StokesScene : public testing::TestWithParam<std::pair<int, Geometry>> {};

TEST_P(StokesScene, TangentIsTheDerivativeOfTheResidual) {
  Scene scene(world(), GetParam().first, GetParam().second);
  const StokesState state = scene.some_state();
  const LinearVector base = residual_at(scene.op, state);
  const LinearSystem& system = scene.op.tangent(state, Tangent::newton);
  for (const Real phase : {0.5, 1.7}) {
    const LinearVector direction = some_direction(scene, phase);
    const LinearVector product = multiply(system, direction);
    const Real h = 1e-5;
    StokesState ahead = state;
    StokesState behind = state;
    scene.op.add_step(direction, h, h, ahead);
    scene.op.add_step(direction, -h, -h, behind);
    const LinearVector above = residual_at(scene.op, ahead);
    const LinearVector below = residual_at(scene.op, behind);
    Real largest = 0;
    for (std::size_t i = 0; i < product.nodes.size(); ++i) {
      largest = std::max(largest, std::abs((above.nodes[i] - below.nodes[i]) / (2 * h) - product.nodes[i]));
    }
    EXPECT_LT(largest, 1e-7);
    EXPECT_NEAR((above.borders[0] - below.borders[0]) / (2 * h), product.borders[0], 1e-7);
  }
}

TEST_P(StokesScene, TangentWithFrozenSubscalesIsSymmetric) {
  Scene scene(world(), GetParam().first, GetParam().second);
  const StokesState state = scene.some_state();
  scene.op.update_viscosity(state);
  LinearVector unused;
  scene.op.residual(state, unused);
  const LinearSystem& system = scene.op.tangent(state, Tangent::symmetric);
  const LinearVector x = some_direction(scene, 0.5);
  const LinearVector y = some_direction(scene, 1.7);
  const Real forward = dot(x, multiply(system, y));
  EXPECT_NEAR(forward, dot(y, multiply(system, x)), 1e-12 * (1 + std::abs(forward)));
}

TEST_P(StokesScene, ProductsWithoutTheMatrixAreThoseOfTheMatrix) {
  Scene scene(world(), GetParam().first, GetParam().second);
  scene.op.set_terms({});
  scene.op.prepare();
  const StokesState state = scene.some_state();
  scene.op.update_viscosity(state);
  const LinearVector x = some_direction(scene, 0.7);
  for (const Tangent kind : {Tangent::picard, Tangent::symmetric, Tangent::newton}) {
    scene.op.use_matrix_free(false);
    const LinearVector expected = multiply(scene.op.tangent(state, kind), x);
    scene.op.use_matrix_free(true);
    const LinearSystem& system = scene.op.tangent(state, kind);
    EXPECT_EQ(system.entries != nullptr, GetParam().second == Geometry::plane);
    const LinearVector product = multiply(system, x);
    Real largest = 0;
    Real error = 0;
    for (std::size_t i = 0; i < product.nodes.size(); ++i) {
      largest = std::max(largest, std::abs(expected.nodes[i]));
      error = std::max(error, std::abs(product.nodes[i] - expected.nodes[i]));
    }
    EXPECT_LT(error, 1e-12 * largest) << "tangent " << static_cast<int>(kind);
    const AssembledMatrix matrix(system);
    LinearSystem assembled = system;
    assembled.matrix = matrix.get();
    EXPECT_NEAR(dot(multiply(assembled, x), x), dot(expected, x), 1e-12 * std::abs(dot(expected, x)));
  }
}

TEST_P(StokesScene, RankCountDoesNotChangeTheEquations) {
  const auto [dim, geometry] = GetParam();
  Scene scene(world(), dim, geometry);
  const Communicator alone(MPI_COMM_SELF);
  // The springs go by global number, which depends on the partition: left out.
  Scene serial(alone, dim, geometry);
  for (Scene* s : {&scene, &serial}) {
    s->op.set_terms({});
    s->op.prepare();
  }
  LinearVector vector;
  const StokesState state = scene.some_state();
  scene.op.update_viscosity(state);
  const ResidualReport parallel = scene.op.residual(state, vector);
  const StokesState serial_state = serial.some_state();
  serial.op.update_viscosity(serial_state);
  const ResidualReport expected = serial.op.residual(serial_state, vector);
  EXPECT_NEAR(parallel.norm, expected.norm, 1e-12 * expected.norm);
  EXPECT_NEAR(parallel.reference, expected.reference, 1e-12 * expected.reference);
  PetscReal norm = 0;
  PetscReal serial_norm = 0;
  MatNorm(scene.op.tangent(state, Tangent::newton).matrix, NORM_FROBENIUS, &norm);
  MatNorm(serial.op.tangent(serial_state, Tangent::newton).matrix, NORM_FROBENIUS, &serial_norm);
  EXPECT_NEAR(norm, serial_norm, 1e-12 * serial_norm);
}

TEST_P(StokesScene, RigidMotionNeedsNoForce) {
  const auto [dim, geometry] = GetParam();
  const Mesh mesh = box_mesh(world(), {.dim = dim, .cells = {3, 4, 5}, .jitter = 0.2});
  const GivenViscosity model(std::vector<Real>(static_cast<std::size_t>(mesh.elements()), 1e3));
  StokesOperator op(world(), mesh, geometry);
  op.set_viscosity(model);
  op.prepare();
  StokesState state = op.start_state();
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    const Real* x = mesh.point(node);
    Real* v = state.nodes.data() + static_cast<std::size_t>(node) * (static_cast<std::size_t>(dim) + 1);
    v[1] = 2;
    if (geometry == Geometry::axisymmetric) continue;
    v[0] = -3 * x[1] + 5;
    v[1] += 3 * x[0];
  }
  op.update_viscosity(state);
  Real fastest = 0;
  for (const Real rate : op.shear_rate()) fastest = std::max(fastest, rate);
  EXPECT_LT(fastest, geometry == Geometry::axisymmetric ? 1e-6 : 1e-13);  // the root of a sum that cancels
  Real largest = 0;
  for (const Real force : op.reactions(state)) largest = std::max(largest, std::abs(force));
  EXPECT_LT(largest, 1e-10);
}

INSTANTIATE_TEST_SUITE_P(Geometries, StokesScene,
                         testing::Values(std::pair{2, Geometry::plane}, std::pair{3, Geometry::plane},
                                         std::pair{2, Geometry::axisymmetric}));

TEST(StokesOperator, MoreRanksThanElementsIsLegal) {
  const Mesh mesh = box_mesh(world(), {.dim = 2, .cells = {1, 1, 1}});
  const GivenViscosity model(std::vector<Real>(static_cast<std::size_t>(mesh.elements()), 1.0));
  StokesOperator op(world(), mesh, Geometry::plane);
  op.set_viscosity(model);
  op.prepare();
  const StokesState state = op.start_state();
  LinearVector residual;
  op.update_viscosity(state);
  EXPECT_EQ(op.residual(state, residual).norm, 0);
  EXPECT_NE(op.tangent(state, Tangent::newton).matrix, nullptr);
}

}  // namespace
}  // namespace malleus
