/// Residual, tangent and what is read off them; the set-up is in stokes_operator.cpp.

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "fem/element_loop.hpp"
#include "fem/stokes_operator.hpp"

namespace malleus {

namespace {

/// P_a block P_b for a pair of nodes; on the diagonal (I - P) times the mean stiffness of the block.
template <int D>
void project_block(const NodeConstraints& constraints, LocalId row, LocalId column,
                   typename ElementMatrix<D>::Block& block) {
  const Real stiffness = row == column ? block.template topLeftCorner<D, D>().trace() / D : 0;
  for (int k = 0; k <= D; ++k) constraints.project(row, block.col(k).data());
  for (int k = 0; k <= D; ++k) {
    Point<D> part = block.template block<1, D>(k, 0).transpose();
    constraints.project(column, part.data());
    block.template block<1, D>(k, 0) = part.transpose();
  }
  if (constraints.is_pressure_fixed(row)) block.row(D).setZero();
  if (constraints.is_pressure_fixed(column)) block.col(D).setZero();
  if (row != column) return;
  const auto directions = constraints.directions(row);
  for (std::size_t k = 0; k < directions.size(); k += D) {
    const Eigen::Map<const Point<D>> direction(directions.data() + k);
    block.template topLeftCorner<D, D>() += stiffness * direction * direction.transpose();
  }
}

}  // namespace

void TangentSink::add(LocalId row, LocalId column, const Real* block) {
  const int dim = constraints_->dim();
  const int size = dim + 1;
  std::array<Real, 16> full{};  // by columns, pressure entries zero
  for (int j = 0; j < dim; ++j) {
    Real* target = full.data() + j * size;
    for (int i = 0; i < dim; ++i) target[i] = block[i * dim + j];
    constraints_->project(row, target);
  }
  for (int i = 0; i < dim; ++i) {
    std::array<Real, 3> part{};
    for (int j = 0; j < dim; ++j) part[static_cast<std::size_t>(j)] = full[static_cast<std::size_t>(j * size + i)];
    constraints_->project(column, part.data());
    for (int j = 0; j < dim; ++j) full[static_cast<std::size_t>(j * size + i)] = part[static_cast<std::size_t>(j)];
  }
  matrix_->add(row, column, full.data());
}

std::vector<Real> StokesOperator::unknowns_in_space(const StokesState& state) const {
  const int size = mesh_->dim + 1;
  std::vector<Real> unknowns = state.nodes;
  unknowns.resize(static_cast<std::size_t>(space_->nodes()) * size, 0.0);
  space_->halo().update_copies(unknowns, size);
  return unknowns;
}

template <class Element>
ElementLoad<Element::dim> StokesOperator::element_load(LocalId element) const {
  constexpr int D = Element::dim;
  ElementLoad<D> load;
  const auto e = static_cast<std::size_t>(element);
  if (!loads_.element_force.empty()) {
    load.force.colwise() += Eigen::Map<const Point<D>>(loads_.element_force.data() + e * D);
  }
  if (!loads_.node_force.empty()) {
    const auto nodes = mesh_->nodes_of_element(element);
    for (int a = 0; a <= D; ++a) {
      const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]);
      load.force.col(a) += Eigen::Map<const Point<D>>(loads_.node_force.data() + node * D);
    }
  }
  if (!loads_.element_divergence.empty()) load.divergence = loads_.element_divergence[e];
  return load;
}

template <int D>
InertiaElement<D> StokesOperator::inertia_of(LocalId element, const ElementUnknowns<D>& unknowns) const {
  const auto e = static_cast<std::size_t>(element);
  ElementInertia<D> inertia;
  inertia.density = inertia_->density[e];
  inertia.rate = inertia_->rate;
  if (!inertia_->history.empty()) {
    const auto nodes = mesh_->nodes_of_element(element);
    for (int a = 0; a <= D; ++a) {
      const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]);
      inertia.history.col(a) = Eigen::Map<const Point<D>>(inertia_->history.data() + node * D);
    }
  }
  return {simplex_points<D>(*mesh_, element), geometry_, inertia, unknowns.velocity, viscosity_[e]};
}

template <class Element>
void StokesOperator::add_elements(std::span<const Real> unknowns, Balance& sums) const {
  constexpr int D = Element::dim;
  const bool loaded = !loads_.element_force.empty() || !loads_.node_force.empty() || !loads_.element_divergence.empty();
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    const Real viscosity = viscosity_[static_cast<std::size_t>(e)];
    if (!(viscosity > 0)) continue;
    const Element element(simplex_points<D>(*mesh_, e));
    const ElementUnknowns<D> values = gather<D>(*mesh_, e, unknowns);
    scatter<D>(*mesh_, e, element.residual(values, viscosity, viscosity), 1, sums.internal);
    if (loaded) scatter<D>(*mesh_, e, element.load(element_load<Element>(e), viscosity), -1, sums.external);
    if (inertia_) {
      const ElementLoad<D> load = element_load<Element>(e);
      scatter<D>(*mesh_, e, inertia_of<D>(e, values).residual(values, load), 1, sums.internal);
    }
    const Real size = viscosity * std::pow(element.volume(), (D - 2.0) / D);
    sums.roundoff += size * size * values.velocity.squaredNorm();
  }
}

template <int D>
void StokesOperator::add_tractions(Balance& sums) const {
  for (const FacetTraction& load : loads_.tractions) {
    const FacetIntegrals<D> integrals = facet_integrals<D>(*mesh_, load.facet, geometry_);
    const Eigen::Map<const Eigen::Matrix<Real, D, D>> traction(load.traction.data());
    const Eigen::Matrix<Real, D, D> force = traction * integrals.mass;
    const auto nodes = mesh_->nodes_of_facet(load.facet);
    for (int a = 0; a < D; ++a) {
      const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]);
      Eigen::Map<Point<D>>(sums.external.data() + node * (D + 1)) -= force.col(a);
    }
  }
}

/// What is not modelled has the stress -p: its forces are those of such an element.
template <class Element>
void StokesOperator::add_void_pressure(Balance& sums) const {
  if (loads_.void_pressure.empty()) return;
  constexpr int D = Element::dim;
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    const Real pressure = loads_.void_pressure[static_cast<std::size_t>(e)];
    if (viscosity_[static_cast<std::size_t>(e)] > 0 || pressure == 0) continue;
    ElementUnknowns<D> uniform;
    uniform.pressure.setConstant(pressure);
    ElementUnknowns<D> forces = Element(simplex_points<D>(*mesh_, e)).residual(uniform, 1, 1);
    forces.pressure.setZero();
    scatter<D>(*mesh_, e, forces, 1, sums.external);
  }
}

void StokesOperator::add_terms(std::span<const Real> unknowns, Balance& sums) const {
  if (terms_.empty()) return;
  const auto dim = static_cast<std::size_t>(mesh_->dim);
  const auto nodes = static_cast<std::size_t>(space_->nodes());
  std::vector<Real> force(nodes * dim, 0.0);
  for (const ResidualTerm* term : terms_) term->add_residual(*space_, unknowns, force);
  for (std::size_t node = 0; node < nodes; ++node) {
    for (std::size_t d = 0; d < dim; ++d) sums.external[node * (dim + 1) + d] += force[node * dim + d];
  }
}

StokesOperator::Balance StokesOperator::balance(const StokesState& state) {
  check(space_ != nullptr, "prepare() was called");
  const int size = mesh_->dim + 1;
  const std::vector<Real> unknowns = unknowns_in_space(state);
  Balance sums;
  sums.internal.assign(unknowns.size(), 0.0);
  sums.external.assign(unknowns.size(), 0.0);
  with_element(mesh_->dim, geometry_, [&]<class Element>(std::type_identity<Element>) {
    add_elements<Element>(unknowns, sums);
    add_void_pressure<Element>(sums);
  });
  with_dim(mesh_->dim, [&](auto d) { add_tractions<decltype(d)::value>(sums); });
  add_terms(unknowns, sums);
  space_->halo().add_to_owners(sums.internal, size);
  space_->halo().add_to_owners(sums.external, size);
  for (std::size_t g = 0; g < gate_columns_.size(); ++g) {
    const GateColumn& column = gate_columns_[g];
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      Real* place = sums.external.data() + static_cast<std::size_t>(column.nodes[k]) * size;
      for (int d = 0; d < mesh_->dim; ++d) {
        place[d] += state.borders[g] * column.values[k * static_cast<std::size_t>(mesh_->dim) + d];
      }
    }
  }
  return sums;
}

/// Rows of the gates, scaled, and how far their flows are from the demanded ones.
void StokesOperator::judge_gates(const StokesState& state, LinearVector& result, ResidualReport& report) const {
  const auto dim = static_cast<std::size_t>(mesh_->dim);
  result.borders.assign(gates_.size(), 0.0);
  for (std::size_t g = 0; g < gates_.size(); ++g) {
    const GateColumn& column = gate_columns_[g];
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      const Real* v = state.nodes.data() + static_cast<std::size_t>(column.nodes[k]) * (dim + 1);
      for (std::size_t d = 0; d < dim; ++d) result.borders[g] += column.values[k * dim + d] * v[d];
    }
  }
  comm_->sum_in_place(result.borders);
  Real largest_flux = 0;
  for (std::size_t g = 0; g < gates_.size(); ++g) {
    const Real flux = gates_[g].flux + gates_[g].compliance * (state.borders[g] - gates_[g].reference);
    result.borders[g] -= flux;
    report.gate_error = std::max(report.gate_error, std::abs(result.borders[g]));
    largest_flux = std::max(largest_flux, std::abs(flux));
    result.borders[g] *= system_.pressure_scale;
  }
  report.gate_error = largest_flux > 0 ? report.gate_error / largest_flux : 0;
}

ResidualReport StokesOperator::residual(const StokesState& state, LinearVector& result) {
  if (!scale_is_chosen_) choose_scale();
  const Real scale = system_.pressure_scale;
  const int dim = mesh_->dim;
  const auto owned = static_cast<std::size_t>(mesh_->owned_nodes());
  const Balance sums = balance(state);
  result.nodes.resize(owned * (dim + 1));
  std::array<Real, 4> squares{0, 0, 0, sums.roundoff};  // residual, internal, external, rounding
  for (std::size_t node = 0; node < owned; ++node) {
    const std::size_t first = node * (dim + 1);
    Real* place = result.nodes.data() + first;
    for (std::size_t k = 0; k <= static_cast<std::size_t>(dim); ++k) {
      place[k] = sums.internal[first + k] + sums.external[first + k];
      if (k == static_cast<std::size_t>(dim)) break;
      squares[1] += sums.internal[first + k] * sums.internal[first + k];
      squares[2] += sums.external[first + k] * sums.external[first + k];
    }
    const auto local = static_cast<LocalId>(node);
    constraints_.project(local, place);
    place[dim] *= constraints_.is_pressure_fixed(local) ? 0 : scale;
  }
  ResidualReport report;
  judge_gates(state, result, report);
  report.net_flow = remove_net_flow(result);
  for (const Real value : result.nodes) squares[0] += value * value;
  comm_->sum_in_place(squares);
  for (const Real value : result.borders) squares[0] += value * value;
  report.norm = std::sqrt(squares[0]);
  report.internal = std::sqrt(std::max(squares[1], 1e-18 * squares[3]));
  report.reference = std::sqrt(std::max({squares[1], squares[2], 1e-18 * squares[3]}));
  return report;
}

void StokesOperator::choose_branches(Branches choice, const StokesState& state) {
  if (terms_.empty()) return;
  const std::vector<Real> unknowns = unknowns_in_space(state);
  for (ResidualTerm* term : terms_) term->choose_branches(choice, *space_, unknowns);
}

template <class Element>
void StokesOperator::add_element_matrices(const StokesState& state, Tangent kind) {
  constexpr int D = Element::dim;
  ElementMatrix<D> local;
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (!(viscosity_[i] > 0)) continue;
    const Element element(simplex_points<D>(*mesh_, e));
    const auto unknowns = gather<D>(*mesh_, e, state.nodes);
    const Real slope = kind == Tangent::picard ? 0 : slope_[i];
    const TangentFactors factors{viscosity_[i], slope, system_.pressure_scale};
    element.matrix(unknowns.velocity, factors, local);
    if (inertia_) {
      inertia_of<D>(e, unknowns)
          .add_matrix(unknowns, element_load<Element>(e), kind != Tangent::picard, system_.pressure_scale, local);
    } else if (kind == Tangent::newton && slope != 0) {
      element.add_subscale_slope(unknowns, element_load<Element>(e), factors, local);
    }
    const auto nodes = mesh_->nodes_of_element(e);
    bool constrained = false;
    for (const LocalId node : nodes) constrained = constrained || !constraints_.is_free(node);
    for (std::size_t a = 0; a <= D; ++a) {
      for (std::size_t b = 0; b <= D; ++b) {
        auto& block = local.blocks[a][b];
        if (constrained) project_block<D>(constraints_, nodes[a], nodes[b], block);
        matrix_->add(nodes[a], nodes[b], block.data());
      }
    }
  }
}

void StokesOperator::scale_borders() {
  const auto dim = static_cast<std::size_t>(mesh_->dim);
  system_.borders.clear();
  for (std::size_t g = 0; g < gates_.size(); ++g) {
    const Real scale = system_.pressure_scale;
    BorderColumn border{gate_columns_[g].nodes, gate_columns_[g].values, -gates_[g].compliance * scale * scale};
    for (std::size_t k = 0; k < border.nodes.size(); ++k) {
      constraints_.project(border.nodes[k], border.values.data() + k * dim);
    }
    for (Real& value : border.values) value *= scale;
    system_.borders.push_back(std::move(border));
  }
}

void StokesOperator::assemble_matrix(const StokesState& state, Tangent kind) {
  if (!matrix_) matrix_ = std::make_unique<SystemMatrix>(*comm_, *space_, tuples_);
  matrix_->start();
  with_element(mesh_->dim, geometry_,
               [&]<class Element>(std::type_identity<Element>) { add_element_matrices<Element>(state, kind); });
  if (!terms_.empty()) {
    const std::vector<Real> unknowns = unknowns_in_space(state);
    TangentSink sink(extended_constraints_, *matrix_);
    for (const ResidualTerm* term : terms_) term->add_tangent(*space_, unknowns, sink);
  }
  matrix_->finish(stiffness_);
}

void StokesOperator::make_matrix_free(const StokesState& state, Tangent kind) {
  matrix_.reset();
  linearized_ = state;
  linearized_kind_ = kind;
  MatrixFreeCoefficients coefficients{.viscosity = viscosity_,
                                      .slope = {},
                                      .state = linearized_.nodes,
                                      .force = {},
                                      .follows_subscales = kind == Tangent::newton,
                                      .pressure_scale = system_.pressure_scale,
                                      .fixed_stiffness = stiffness_};
  if (kind != Tangent::picard) coefficients.slope = slope_;
  if (kind == Tangent::newton) coefficients.force = force_density();
  products_ = std::make_unique<MatrixFreeTangent>(*comm_, *mesh_, constraints_, std::move(coefficients));
}

Mat StokesOperator::assemble() {
  assemble_matrix(linearized_, linearized_kind_);
  return matrix_->matrix();
}

void StokesOperator::release() {
  matrix_.reset();
}

const LinearSystem& StokesOperator::tangent(const StokesState& state, Tangent kind) {
  check(space_ != nullptr, "prepare() was called");
  if (!scale_is_chosen_) choose_scale();
  products_.reset();
  if (is_matrix_free()) {
    make_matrix_free(state, kind);
  } else {
    assemble_matrix(state, kind);
  }
  scale_borders();
  system_.comm = comm_;
  system_.mesh = mesh_;
  system_.matrix = products_ ? products_->matrix() : matrix_->matrix();
  system_.entries = products_ ? this : nullptr;
  system_.constraints = &constraints_;
  system_.element_viscosity = viscosity_;
  system_.element_volume = volume_;
  inertia_rate_.clear();
  if (inertia_) {
    for (const Real density : inertia_->density) inertia_rate_.push_back(density * inertia_->rate);
  }
  system_.element_inertia = inertia_rate_;
  system_.axisymmetric = geometry_ == Geometry::axisymmetric;
  system_.pressure_is_free = pressure_is_free_;
  ++system_.value_version;
  return system_;
}

void StokesOperator::add_step(const LinearVector& step, Real velocity_factor, Real pressure_factor,
                              StokesState& state) const {
  const auto size = static_cast<std::size_t>(mesh_->dim) + 1;
  const Real scaled = pressure_factor * system_.pressure_scale;
  for (std::size_t i = 0; i < step.nodes.size(); ++i) {
    state.nodes[i] += (i % size == size - 1 ? scaled : velocity_factor) * step.nodes[i];
  }
  for (std::size_t g = 0; g < step.borders.size(); ++g) state.borders[g] += scaled * step.borders[g];
  mesh_->node_halo.update_copies(state.nodes, mesh_->dim + 1);
}

Real StokesOperator::residual_power(const LinearVector& residual, const LinearVector& step) const {
  const auto size = static_cast<std::size_t>(mesh_->dim) + 1;
  Real power = 0;
  for (std::size_t i = 0; i < step.nodes.size(); ++i) {
    if (i % size != size - 1) power += residual.nodes[i] * step.nodes[i];
  }
  return comm_->sum(power);
}

std::vector<Real> StokesOperator::reactions(const StokesState& state) {
  const Balance sums = balance(state);
  const auto dim = static_cast<std::size_t>(mesh_->dim);
  const auto owned = static_cast<std::size_t>(mesh_->owned_nodes());
  std::vector<Real> forces(owned * dim);
  for (std::size_t node = 0; node < owned; ++node) {
    for (std::size_t d = 0; d < dim; ++d) {
      const std::size_t k = node * (dim + 1) + d;
      forces[node * dim + d] = sums.internal[k] + sums.external[k];
    }
  }
  return forces;
}

Real StokesOperator::dissipation(const StokesState& state) const {
  Real power = 0;
  with_element(mesh_->dim, geometry_, [&]<class Element>(std::type_identity<Element>) {
    constexpr int D = Element::dim;
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      const Real viscosity = viscosity_[static_cast<std::size_t>(e)];
      if (!(viscosity > 0)) continue;
      const ElementUnknowns<D> values = gather<D>(*mesh_, e, state.nodes);
      const ElementUnknowns<D> forces = Element(simplex_points<D>(*mesh_, e)).residual(values, viscosity, viscosity);
      // v.(A v + B^T p) - p.(B v - C p) = v A v + p C p
      power += forces.velocity.cwiseProduct(values.velocity).sum() - forces.pressure.dot(values.pressure);
    }
  });
  return comm_->sum(power);
}

std::vector<Real> StokesOperator::subscale_velocity(const StokesState& state) const {
  std::vector<Real> result(static_cast<std::size_t>(mesh_->elements()) * static_cast<std::size_t>(mesh_->dim), 0.0);
  with_dim(mesh_->dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      if (!(viscosity_[i] > 0)) continue;
      const MiniElement<D> element(simplex_points<D>(*mesh_, e));
      const ElementUnknowns<D> values = gather<D>(*mesh_, e, state.nodes);
      const ElementLoad<D> load = element_load<MiniElement<D>>(e);
      Eigen::Map<Point<D>>(result.data() + i * D) = inertia_ ? inertia_of<D>(e, values).subscale_velocity(values, load)
                                                             : element.subscale_velocity(values, load, viscosity_[i]);
    }
  });
  return result;
}

std::vector<Real> StokesOperator::force_density() const {
  if (loads_.element_force.empty() && loads_.node_force.empty()) return {};
  std::vector<Real> result(static_cast<std::size_t>(mesh_->elements()) * static_cast<std::size_t>(mesh_->dim));
  with_dim(mesh_->dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      Eigen::Map<Point<D>>(result.data() + static_cast<std::size_t>(e) * D) =
          element_load<MiniElement<D>>(e).force.rowwise().mean();
    }
  });
  return result;
}

WorstNode StokesOperator::worst_node(const LinearVector& residual) const {
  const int dim = mesh_->dim;
  WorstNode worst;
  for (LocalId node = 0; node < mesh_->owned_nodes(); ++node) {
    const Real* force = residual.nodes.data() + static_cast<std::size_t>(node) * (dim + 1);
    const Real size = std::hypot(force[0], force[1], dim == 3 ? force[2] : 0);
    if (!(size > worst.force)) continue;
    worst.force = size;
    std::copy_n(mesh_->point(node), dim, worst.place.begin());
  }
  const Real largest = comm_->max(worst.force);
  const GlobalId candidate = worst.force == largest ? comm_->rank() : comm_->size();
  const int root = static_cast<int>(comm_->min(candidate));
  worst.force = largest;
  comm_->broadcast(worst.place, root);
  return worst;
}

}  // namespace malleus
