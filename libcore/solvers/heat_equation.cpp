#include "solvers/heat_equation.hpp"

#include <algorithm>
#include <cmath>

#include "base/floating_point.hpp"
#include "base/index.hpp"
#include "fem/heat_element.hpp"
#include "solvers/petsc_objects.hpp"

namespace malleus {
namespace {

constexpr int most_newton = 25;
constexpr Real settled = 1e-10;  ///< a change of the temperature by less than this share of it
/// From this ratio of conduction to capacity in a row on, the iterations of Jacobi's preconditioner grow with the mesh,
/// which matters from so many nodes on.
constexpr Real diffusive = 200;
constexpr GlobalId many_nodes = 20'000;
constexpr PetscInt most_iterations = 5000;

Real at_or_zero(const std::vector<Real>& values, LocalId i) {
  return values.empty() ? 0 : values[index(i)];
}

Real cube(Real x) {
  return x * x * x;
}

/// The nodes of a bridge with their parts of it: 1 and minus the weights.
struct BridgeEnds {
  std::array<GlobalId, 4> nodes{};
  std::array<Real, 4> parts{};
  std::size_t count = 0;
};

BridgeEnds ends_of(const HeatBridge& bridge) {
  BridgeEnds ends;
  ends.nodes[0] = bridge.node;
  ends.parts[0] = 1;
  ends.count = 1;
  for (std::size_t k = 0; k < bridge.partners.size() && bridge.partners[k] >= 0; ++k, ++ends.count) {
    ends.nodes[ends.count] = bridge.partners[k];
    ends.parts[ends.count] = -bridge.weights[k];
  }
  return ends;
}

/// visit(e, element, nodes) for each element that holds heat, element being its HeatElement.
template <class Visit>
void for_each_heat_element(const Mesh& mesh, Geometry geometry, const HeatScene& scene, Visit visit) {
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (!(scene.capacity[index(e)] > 0)) continue;
      visit(e, heat_element<D>(simplex_points<D>(mesh, e), geometry), mesh.nodes_of_element(e));
    }
  });
}

NodeSpace space_of(const Communicator& comm, const Mesh& mesh, const HeatScene& scene) {
  std::vector<GlobalId> wanted;
  for (const HeatBridge& bridge : scene.bridges) {
    const BridgeEnds ends = ends_of(bridge);
    wanted.insert(wanted.end(), ends.nodes.begin(), ends.nodes.begin() + static_cast<std::ptrdiff_t>(ends.count));
  }
  return NodeSpace(comm, mesh, wanted);
}

}  // namespace

/// The matrix of a step, given as entries row, column, value of which any rank may have any, and its solver.
class HeatEquation::System {
 public:
  void start() {
    values_.clear();
    rows_next_.clear();
    columns_next_.clear();
  }
  void add(GlobalId row, GlobalId column, Real value) {
    rows_next_.push_back(static_cast<PetscInt>(row));
    columns_next_.push_back(static_cast<PetscInt>(column));
    values_.push_back(value);
  }
  /// fixed: owned global rows that keep their value. Collective.
  void finish(const Communicator& comm, LocalId owned, const std::vector<PetscInt>& fixed, bool is_diffusive);
  /// x from A x = b, both [owned node]; the iterations, negative where it did not converge. Collective.
  int solve(std::vector<Real>& b, std::vector<Real>& x, Real tolerance, Real floor);

 private:
  std::vector<PetscInt> rows_, columns_;            ///< of the pattern that the matrix has
  std::vector<PetscInt> rows_next_, columns_next_;  ///< of the one being added
  std::vector<Real> values_;
  PetscMatrix matrix_;
  PetscVector in_, out_;
  PetscSolver solver_;
};

void HeatEquation::System::finish(const Communicator& comm, LocalId owned, const std::vector<PetscInt>& fixed,
                                  bool is_diffusive) {
  const bool is_new = !matrix_ || rows_ != rows_next_ || columns_ != columns_next_;
  if (comm.any(is_new)) {
    rows_ = rows_next_;
    columns_ = columns_next_;
    petsc_call(MatCreate(comm.raw(), matrix_.out()));
    petsc_call(MatSetSizes(matrix_.get(), owned, owned, PETSC_DETERMINE, PETSC_DETERMINE));
    petsc_call(MatSetType(matrix_.get(), MATAIJ));
    // The call sorts the lists that it is given.
    petsc_call(MatSetPreallocationCOO(matrix_.get(), static_cast<PetscCount>(rows_.size()), rows_next_.data(),
                                      columns_next_.data()));
    petsc_call(MatSetOption(matrix_.get(), MAT_KEEP_NONZERO_PATTERN, PETSC_TRUE));
    petsc_call(MatCreateVecs(matrix_.get(), out_.out(), in_.out()));
  }
  petsc_call(MatSetValuesCOO(matrix_.get(), values_.data(), INSERT_VALUES));
  petsc_call(MatZeroRowsColumns(matrix_.get(), static_cast<PetscInt>(fixed.size()), fixed.data(), 1, nullptr, nullptr));
  petsc_call(KSPCreate(comm.raw(), solver_.out()));
  petsc_call(KSPSetOptionsPrefix(solver_.get(), "heat_"));
  petsc_call(KSPSetType(solver_.get(), KSPCG));
  petsc_call(KSPSetNormType(solver_.get(), KSP_NORM_UNPRECONDITIONED));
  petsc_call(KSPSetOperators(solver_.get(), matrix_.get(), matrix_.get()));
  PC pc = nullptr;
  petsc_call(KSPGetPC(solver_.get(), &pc));
  petsc_call(PCSetType(pc, is_diffusive ? PCGAMG : PCJACOBI));
  petsc_call(KSPSetFromOptions(solver_.get()));
}

int HeatEquation::System::solve(std::vector<Real>& b, std::vector<Real>& x, Real tolerance, Real floor) {
  const TrapsOff traps_off;
  petsc_call(KSPSetTolerances(solver_.get(), tolerance, floor, PETSC_DEFAULT, most_iterations));
  petsc_call(VecPlaceArray(in_.get(), b.data()));
  petsc_call(VecPlaceArray(out_.get(), x.data()));
  petsc_call(KSPSolve(solver_.get(), in_.get(), out_.get()));
  petsc_call(VecResetArray(in_.get()));
  petsc_call(VecResetArray(out_.get()));
  PetscInt iterations = 0;
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  petsc_call(KSPGetIterationNumber(solver_.get(), &iterations));
  petsc_call(KSPGetConvergedReason(solver_.get(), &reason));
  return reason > 0 ? static_cast<int>(iterations) : -1 - static_cast<int>(iterations);
}

HeatEquation::HeatEquation(const Communicator& comm, const Mesh& mesh, Geometry geometry, Real tolerance)
    : comm_(comm), mesh_(mesh), geometry_(geometry), tolerance_(tolerance), system_(std::make_unique<System>()) {}

HeatEquation::~HeatEquation() = default;

/// Nodes whose temperature the step does not change: imposed, or of no modelled element. Their masses on the way.
void HeatEquation::mark_fixed(const HeatScene& scene) {
  masses_.assign(index(mesh_.nodes()), 0.0);
  for_each_heat_element(mesh_, geometry_, scene, [&](LocalId e, const auto& element, const auto& nodes) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      masses_[index(nodes[i])] += scene.capacity[index(e)] * element.masses[static_cast<Eigen::Index>(i)];
    }
  });
  mesh_.node_halo.add_to_owners(masses_, 1);
  mesh_.node_halo.update_copies(std::span(masses_), 1);
  is_fixed_.assign(masses_.size(), 0);
  for (std::size_t i = 0; i < masses_.size(); ++i) is_fixed_[i] = masses_[i] > 0 ? 0 : 1;
  for (const LocalId node : scene.fixed) is_fixed_[index(node)] = 1;
}

void HeatEquation::add_conduction(const HeatScene& scene, std::span<const Real> temperature,
                                  std::span<Real> sums) const {
  for_each_heat_element(mesh_, geometry_, scene, [&](LocalId e, const auto& element, const auto& nodes) {
    auto local = element.masses;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      local[static_cast<Eigen::Index>(i)] = temperature[index(nodes[i])];
    }
    const auto flows = (scene.conductivity[index(e)] * element.stiffness * local -
                        at_or_zero(scene.element_source, e) * element.masses)
                           .eval();
    for (std::size_t i = 0; i < nodes.size(); ++i) sums[index(nodes[i])] += flows[static_cast<Eigen::Index>(i)];
  });
}

/// [node of the space] W that the equation of each node leaves over, complete on owned nodes: heat that goes in and is
/// neither stored nor passed on is negative.
std::vector<Real> HeatEquation::residual(const HeatScene& scene, const NodeSpace& space, std::span<const Real> before,
                                         std::span<const Real> temperature, Real dt) const {
  std::vector<Real> sums(index(space.nodes()), 0.0);
  add_conduction(scene, temperature, sums);
  const Real far = cube(scene.radiates_to) * scene.radiates_to;
  for (LocalId node = 0; node < mesh_.nodes(); ++node) {
    const Real t = temperature[index(node)];
    sums[index(node)] += at_or_zero(scene.conductance, node) * t - at_or_zero(scene.surroundings, node) -
                         at_or_zero(scene.node_source, node) + at_or_zero(scene.emission, node) * (cube(t) * t - far);
    if (node < mesh_.owned_nodes()) sums[index(node)] += masses_[index(node)] * (t - before[index(node)]) / dt;
  }
  std::vector<Real> known(index(space.nodes()), 0.0);
  std::copy_n(temperature.begin(), index(space.owned()), known.begin());
  space.halo().update_copies(std::span(known), 1);
  for (const HeatBridge& bridge : scene.bridges) {
    const BridgeEnds ends = ends_of(bridge);
    Real difference = 0;
    for (std::size_t i = 0; i < ends.count; ++i) {
      difference += ends.parts[i] * known[index(space.local_node(ends.nodes[i]))];
    }
    for (std::size_t i = 0; i < ends.count; ++i) {
      const Real given = i > 0 ? ends.parts[i] * bridge.source : 0;
      sums[index(space.local_node(ends.nodes[i]))] += ends.parts[i] * bridge.conductance * difference + given;
    }
  }
  space.halo().add_to_owners(std::span(sums), 1);
  return sums;
}

void HeatEquation::assemble(const HeatScene& scene, Real dt, std::span<const Real> temperature) {
  system_->start();
  std::vector<Real> conduction(index(mesh_.nodes()), 0.0);
  for_each_heat_element(mesh_, geometry_, scene, [&](LocalId e, const auto& element, const auto& nodes) {
    const Real k = scene.conductivity[index(e)];
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      conduction[index(nodes[i])] += k * element.stiffness(row, row);
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        system_->add(mesh_.global_node(nodes[i]), mesh_.global_node(nodes[j]),
                     k * element.stiffness(row, static_cast<Eigen::Index>(j)));
      }
    }
  });
  std::vector<PetscInt> fixed;
  Real largest = 0;
  for (LocalId node = 0; node < mesh_.nodes(); ++node) {
    const Real stored = node < mesh_.owned_nodes() ? masses_[index(node)] / dt : 0;
    const Real radiated = 4 * at_or_zero(scene.emission, node) * cube(temperature[index(node)]);
    system_->add(mesh_.global_node(node), mesh_.global_node(node),
                 stored + at_or_zero(scene.conductance, node) + radiated);
    if (node >= mesh_.owned_nodes()) continue;
    if (is_fixed_[index(node)] != 0) fixed.push_back(static_cast<PetscInt>(mesh_.global_node(node)));
    if (stored > 0) largest = std::max(largest, conduction[index(node)] / stored);
  }
  for (const HeatBridge& bridge : scene.bridges) {
    const BridgeEnds ends = ends_of(bridge);
    for (std::size_t i = 0; i < ends.count; ++i) {
      for (std::size_t j = 0; j < ends.count; ++j) {
        system_->add(ends.nodes[i], ends.nodes[j], ends.parts[i] * ends.parts[j] * bridge.conductance);
      }
    }
  }
  system_->finish(comm_, mesh_.owned_nodes(), fixed,
                  mesh_.total_nodes() > many_nodes && comm_.max(largest) > diffusive);
}

HeatReport HeatEquation::advance(const HeatScene& scene, Real dt, std::span<Real> temperature) {
  mark_fixed(scene);
  const std::vector<Real> before(temperature.begin(), temperature.end());
  for (std::size_t i = 0; i < scene.fixed.size(); ++i) temperature[index(scene.fixed[i])] = scene.fixed_values[i];
  const NodeSpace space = space_of(comm_, mesh_, scene);
  const auto owned = index(mesh_.owned_nodes());
  Real warmth = 0;  // W: stored by all in a step, for what rounding leaves
  Real hottest = 0;
  for (std::size_t i = 0; i < owned; ++i) {
    warmth += std::pow(masses_[i] * before[i] / dt, 2);
    hottest = std::max(hottest, std::abs(before[i]));
  }
  const Real floor = 1e-14 * std::sqrt(comm_.sum(warmth));
  hottest = comm_.max(hottest);
  int iterations = 0;
  bool converged = true;
  const bool radiates = comm_.any(!scene.emission.empty());
  for (int step = 0; step < most_newton; ++step) {
    std::vector<Real> right = residual(scene, space, before, temperature, dt);
    right.resize(owned);
    for (std::size_t i = 0; i < owned; ++i) right[i] = is_fixed_[i] != 0 ? 0 : -right[i];
    assemble(scene, dt, temperature);
    std::vector<Real> change(owned, 0.0);
    const int taken = system_->solve(right, change, tolerance_, floor);
    converged = converged && taken >= 0;
    iterations += std::abs(taken);
    Real largest = 0;
    for (std::size_t i = 0; i < owned; ++i) {
      temperature[i] += change[i];
      largest = std::max(largest, std::abs(change[i]));
    }
    mesh_.node_halo.update_copies(temperature, 1);
    if (!radiates || comm_.max(largest) <= settled * hottest || !converged) break;
    converged = step + 1 < most_newton;
  }
  HeatReport report = account(scene, dt, before, temperature, residual(scene, space, before, temperature, dt));
  report.iterations = iterations;
  report.converged = converged;
  return report;
}

HeatReport HeatEquation::account(const HeatScene& scene, Real dt, std::span<const Real> before,
                                 std::span<const Real> after, std::span<const Real> residual) const {
  std::array<Real, 4> sums = {0, 0, 0, 0};  // stored, supplied, lost, imposed
  const Real far = cube(scene.radiates_to) * scene.radiates_to;
  for (LocalId node = 0; node < mesh_.nodes(); ++node) {
    const Real t = after[index(node)];
    sums[1] += dt * at_or_zero(scene.node_source, node);
    sums[2] += dt * (at_or_zero(scene.conductance, node) * t - at_or_zero(scene.surroundings, node) +
                     at_or_zero(scene.emission, node) * (cube(t) * t - far));
    if (node >= mesh_.owned_nodes()) continue;
    sums[0] += masses_[index(node)] * (t - before[index(node)]);
    if (is_fixed_[index(node)] != 0) sums[3] += dt * residual[index(node)];
  }
  for (const HeatBridge& bridge : scene.bridges) sums[1] += dt * bridge.source;
  with_dim(mesh_.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh_.elements() && !scene.element_source.empty(); ++e) {
      if (!(scene.capacity[index(e)] > 0)) continue;
      sums[1] +=
          dt * scene.element_source[index(e)] * heat_element<D>(simplex_points<D>(mesh_, e), geometry_).masses.sum();
    }
  });
  comm_.sum_in_place(sums);
  HeatReport report;
  report.stored = sums[0];
  report.supplied = sums[1];
  report.lost = sums[2];
  report.imposed = sums[3];
  return report;
}

}  // namespace malleus
