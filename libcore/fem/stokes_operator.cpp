#include "fem/stokes_operator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace malleus {

namespace {

/// Calls function(std::type_identity<Element>) with the element of a scene.
template <class Function>
void with_element(int dim, Geometry geometry, Function&& function) {
  if (dim == 3) return function(std::type_identity<MiniElement<3>>{});
  if (geometry == Geometry::axisymmetric) return function(std::type_identity<AxisymmetricMiniElement>{});
  return function(std::type_identity<MiniElement<2>>{});
}

template <int D>
ElementUnknowns<D> gather(const Mesh& mesh, LocalId element, std::span<const Real> unknowns) {
  ElementUnknowns<D> result;
  const auto nodes = mesh.nodes_of_element(element);
  for (int a = 0; a <= D; ++a) {
    const Real* values = unknowns.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * (D + 1);
    result.velocity.col(a) = Eigen::Map<const Point<D>>(values);
    result.pressure[a] = values[D];
  }
  return result;
}

template <int D>
void scatter(const Mesh& mesh, LocalId element, const ElementUnknowns<D>& values, Real sign, std::vector<Real>& sums) {
  const auto nodes = mesh.nodes_of_element(element);
  for (int a = 0; a <= D; ++a) {
    Real* place = sums.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * (D + 1);
    for (int d = 0; d < D; ++d) place[d] += sign * values.velocity(d, a);
    place[D] += sign * values.pressure[a];
  }
}

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

StokesOperator::StokesOperator(const Communicator& comm, const Mesh& mesh, Geometry geometry)
    : comm_(&comm), mesh_(&mesh), geometry_(geometry), constraints_(mesh.dim, mesh.nodes()) {
  check(geometry == Geometry::plane || mesh.dim == 2, "axisymmetric scenes have two dimensions");
}

void StokesOperator::prepare() {
  compute_volumes();
  find_still_elements();
  fix_unmodelled_nodes();
  NodeTuples tuples;
  for (const ResidualTerm* term : terms_) term->extra_couplings(tuples);
  const bool changed = space_ == nullptr || !(tuples == tuples_);
  if (comm_->any(changed)) {
    tuples_ = std::move(tuples);
    matrix_.reset();
    space_ = std::make_unique<NodeSpace>(*comm_, *mesh_, tuples_.nodes);
    matrix_ = std::make_unique<SystemMatrix>(*comm_, *space_, tuples_);
    ++system_.pattern_version;
  }
  extended_constraints_ = constraints_.extended(space_->halo());
  gate_columns_.clear();
  for (const FluxGate& gate : gates_) gate_columns_.push_back(gate_column(gate));
  scale_is_chosen_ = false;
  find_pressure_null();
}

/// A pressure of one everywhere, with that of every gate, must push on no free direction: then it is a null vector.
void StokesOperator::find_pressure_null() {
  const int dim = mesh_->dim;
  const int size = dim + 1;
  std::vector<Real> push(static_cast<std::size_t>(mesh_->nodes()) * size, 0.0);  // force [N], then volume [m^3]
  with_element(dim, geometry_, [&]<class Element>(std::type_identity<Element>) {
    constexpr int D = Element::dim;
    ElementUnknowns<D> uniform;
    uniform.pressure.setOnes();
    ElementLoad<D> expansion;
    expansion.divergence = -1;
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      if (!(viscosity_[static_cast<std::size_t>(e)] > 0)) continue;
      const Element element(simplex_points<D>(*mesh_, e));
      ElementUnknowns<D> sums = element.residual(uniform, 1, 1);
      sums.pressure = element.load(expansion, 1).pressure;
      scatter<D>(*mesh_, e, sums, 1, push);
    }
  });
  mesh_->node_halo.add_to_owners(push, size);
  for (const GateColumn& gate : gate_columns_) {
    for (std::size_t k = 0; k < gate.nodes.size(); ++k) {
      Real* place = push.data() + static_cast<std::size_t>(gate.nodes[k]) * size;
      for (int d = 0; d < dim; ++d) place[d] += gate.values[k * static_cast<std::size_t>(dim) + d];
    }
  }
  Real largest = 0;
  Real free = 0;
  node_volume_.resize(static_cast<std::size_t>(mesh_->owned_nodes()));
  for (LocalId node = 0; node < mesh_->owned_nodes(); ++node) {
    Real* place = push.data() + static_cast<std::size_t>(node) * size;
    node_volume_[static_cast<std::size_t>(node)] = place[dim];
    for (int d = 0; d < dim; ++d) largest = std::max(largest, std::abs(place[d]));
    constraints_.project(node, place);
    for (int d = 0; d < dim; ++d) free = std::max(free, std::abs(place[d]));
  }
  pressure_is_free_ = comm_->max(free) <= 1e-8 * comm_->max(largest);
  if (!pressure_is_free_) node_volume_.clear();
}

void StokesOperator::remove_pressure_mean(StokesState& state) const {
  if (!pressure_is_free_) return;
  const auto size = static_cast<std::size_t>(mesh_->dim) + 1;
  std::array<Real, 2> sums{};
  for (std::size_t node = 0; node < node_volume_.size(); ++node) {
    sums[0] += node_volume_[node] * state.nodes[node * size + size - 1];
    sums[1] += node_volume_[node];
  }
  comm_->sum_in_place(sums);
  const Real mean = sums[1] > 0 ? sums[0] / sums[1] : 0;
  for (LocalId node = 0; node < mesh_->nodes(); ++node) {
    if (!constraints_.is_pressure_fixed(node)) state.nodes[static_cast<std::size_t>(node) * size + size - 1] -= mean;
  }
  for (Real& pressure : state.borders) pressure -= mean;
}

/// Makes a residual orthogonal to the null vector by a uniform div v; returns the flow that it takes out [m^3/s].
Real StokesOperator::remove_net_flow(LinearVector& residual) const {
  if (!pressure_is_free_) return 0;
  const auto size = static_cast<std::size_t>(mesh_->dim) + 1;
  std::array<Real, 2> sums{};
  for (std::size_t node = 0; node < node_volume_.size(); ++node) {
    sums[0] += residual.nodes[node * size + size - 1];
    sums[1] += node_volume_[node];
  }
  comm_->sum_in_place(sums);
  for (const Real value : residual.borders) sums[0] += value;
  if (!(sums[1] > 0)) return 0;
  for (std::size_t node = 0; node < node_volume_.size(); ++node) {
    residual.nodes[node * size + size - 1] -= sums[0] / sums[1] * node_volume_[node];
  }
  return -sums[0] / system_.pressure_scale;
}

void StokesOperator::compute_volumes() {
  const auto elements = static_cast<std::size_t>(mesh_->elements());
  volume_.resize(elements);
  shear_rate_.assign(elements, 0.0);
  viscosity_.assign(elements, 0.0);
  slope_.assign(elements, 0.0);
  Real plain = 0;
  Real smallest = std::numeric_limits<Real>::max();
  with_element(mesh_->dim, geometry_, [&]<class Element>(std::type_identity<Element>) {
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      const auto points = simplex_points<Element::dim>(*mesh_, e);
      const Real signed_volume = simplex_volume<Element::dim>(points);
      smallest = std::min(smallest, signed_volume);
      plain += signed_volume;
      volume_[static_cast<std::size_t>(e)] = signed_volume > 0 ? Element(points).volume() : 0;
    }
  });
  check(comm_->min(smallest) > 0, "elements are not inverted when the flow is solved");
  const Real mean = comm_->sum(plain) / static_cast<Real>(std::max<GlobalId>(1, mesh_->total_elements));
  length_ = std::pow(mean, 1.0 / mesh_->dim);
}

void StokesOperator::find_still_elements() {
  still_.clear();
  if (!leaves_out_still_) return;
  const int dim = mesh_->dim;
  const auto is_at_rest = [&](LocalId node) {
    std::array<Real, 3> velocity = {1, 1, 1};
    constraints_.impose(node, velocity.data());
    return constraints_.fixed_directions(node) == dim &&
           std::all_of(velocity.begin(), velocity.begin() + dim, [](Real v) { return v == 0; });
  };
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    const auto nodes = mesh_->nodes_of_element(e);
    if (std::all_of(nodes.begin(), nodes.end(), is_at_rest)) still_.push_back(e);
  }
}

void StokesOperator::leave_out_still() {
  for (const LocalId e : still_) {
    viscosity_[static_cast<std::size_t>(e)] = 0;
    slope_[static_cast<std::size_t>(e)] = 0;
  }
}

void StokesOperator::fix_unmodelled_nodes() {
  check(model_ != nullptr, "the operator has a viscosity");
  update_viscosity(1.0);  // any rate tells what is modelled
  if (comm_->all(std::all_of(viscosity_.begin(), viscosity_.end(), [](Real eta) { return eta > 0; }))) return;
  std::vector<Real> modelled(static_cast<std::size_t>(mesh_->nodes()), 0.0);
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    if (!(viscosity_[static_cast<std::size_t>(e)] > 0)) continue;
    for (const LocalId node : mesh_->nodes_of_element(e)) modelled[static_cast<std::size_t>(node)] = 1;
  }
  mesh_->node_halo.max_to_owners(modelled, 1);
  mesh_->node_halo.update_copies(modelled, 1);
  constexpr std::array<Real, 3> rest{};
  for (LocalId node = 0; node < mesh_->nodes(); ++node) {
    if (modelled[static_cast<std::size_t>(node)] > 0) continue;
    constraints_.fix_velocity(node, rest.data());
    constraints_.fix_pressure(node);
  }
}

void StokesOperator::choose_scale() {
  // s = eta / L, with the geometric mean viscosity and the size of what is modelled: the dimensionless equations. In
  // their norm a tolerance means the same on any mesh (with an element's size for L it would not).
  std::array<Real, 3> sums{};
  for (std::size_t e = 0; e < viscosity_.size(); ++e) {
    if (!(viscosity_[e] > 0)) continue;
    sums[0] += volume_[e] * std::log(viscosity_[e]);
    sums[1] += volume_[e];
    sums[2] += 1;
  }
  comm_->sum_in_place(sums);
  const Real viscosity = sums[1] > 0 ? std::exp(sums[0] / sums[1]) : 1;
  system_.pressure_scale = viscosity / (length_ * std::pow(std::max(1.0, sums[2]), 1.0 / mesh_->dim));
  stiffness_ = viscosity * std::pow(length_, mesh_->dim - 2);
  scale_is_chosen_ = true;
}

StokesOperator::GateColumn StokesOperator::gate_column(const FluxGate& gate) const {
  const int dim = mesh_->dim;
  std::vector<Real> dense(static_cast<std::size_t>(mesh_->nodes()) * dim, 0.0);
  with_dim(dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (const LocalId facet : gate.facets) {
      const FacetIntegrals<D> integrals = facet_integrals<D>(*mesh_, facet, geometry_);
      const auto shares = integrals.shares();
      const auto nodes = mesh_->nodes_of_facet(facet);
      for (int a = 0; a < D; ++a) {
        Eigen::Map<Point<D>>(dense.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * D) +=
            shares[a] * integrals.normal;
      }
    }
  });
  mesh_->node_halo.add_to_owners(dense, dim);
  GateColumn column;
  for (LocalId node = 0; node < mesh_->owned_nodes(); ++node) {
    const Real* value = dense.data() + static_cast<std::size_t>(node) * dim;
    if (std::all_of(value, value + dim, [](Real x) { return x == 0; })) continue;
    column.nodes.push_back(node);
    column.values.insert(column.values.end(), value, value + dim);
  }
  return column;
}

StokesState StokesOperator::start_state() const {
  StokesState state;
  state.nodes.assign(static_cast<std::size_t>(mesh_->nodes()) * (mesh_->dim + 1), 0.0);
  impose_constraints(state);
  return state;
}

void StokesOperator::impose_constraints(StokesState& state) const {
  for (LocalId node = 0; node < mesh_->nodes(); ++node) {
    constraints_.impose(node, state.nodes.data() + static_cast<std::size_t>(node) * (mesh_->dim + 1));
  }
  state.borders.resize(gates_.size(), 0.0);
}

void StokesOperator::update_viscosity(const StokesState& state) {
  with_element(mesh_->dim, geometry_, [&]<class Element>(std::type_identity<Element>) {
    constexpr int D = Element::dim;
    for (LocalId e = 0; e < mesh_->elements(); ++e) {
      const Element element(simplex_points<D>(*mesh_, e));
      shear_rate_[static_cast<std::size_t>(e)] = element.shear_rate(gather<D>(*mesh_, e, state.nodes).velocity);
    }
  });
  model_->evaluate(*mesh_, shear_rate_, viscosity_, slope_);
  leave_out_still();
}

void StokesOperator::update_viscosity(Real uniform_shear_rate) {
  std::fill(shear_rate_.begin(), shear_rate_.end(), uniform_shear_rate);
  model_->evaluate(*mesh_, shear_rate_, viscosity_, slope_);
  leave_out_still();
}

bool StokesOperator::is_linear() const {
  return model_->is_linear() &&
         std::all_of(terms_.begin(), terms_.end(), [](const ResidualTerm* term) { return term->is_linear(); });
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
  with_element(mesh_->dim, geometry_,
               [&]<class Element>(std::type_identity<Element>) { add_elements<Element>(unknowns, sums); });
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
  result.borders.assign(gates_.size(), 0.0);
  for (std::size_t g = 0; g < gates_.size(); ++g) {
    const GateColumn& column = gate_columns_[g];
    for (std::size_t k = 0; k < column.nodes.size(); ++k) {
      const Real* v = state.nodes.data() + static_cast<std::size_t>(column.nodes[k]) * (dim + 1);
      for (int d = 0; d < dim; ++d) result.borders[g] += column.values[k * static_cast<std::size_t>(dim) + d] * v[d];
    }
  }
  comm_->sum_in_place(result.borders);
  for (std::size_t g = 0; g < gates_.size(); ++g) result.borders[g] = scale * (result.borders[g] - gates_[g].flux);
  ResidualReport report;
  report.net_flow = remove_net_flow(result);
  for (const Real value : result.nodes) squares[0] += value * value;
  comm_->sum_in_place(squares);
  for (const Real value : result.borders) squares[0] += value * value;
  report.norm = std::sqrt(squares[0]);
  report.reference = std::sqrt(std::max({squares[1], squares[2], 1e-18 * squares[3]}));
  return report;
}

template <class Element>
void StokesOperator::add_element_matrices(const StokesState& state, bool newton) {
  constexpr int D = Element::dim;
  ElementMatrix<D> local;
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (!(viscosity_[i] > 0)) continue;
    const Element element(simplex_points<D>(*mesh_, e));
    const auto velocity = gather<D>(*mesh_, e, state.nodes).velocity;
    element.matrix(velocity, viscosity_[i], newton ? slope_[i] : 0, system_.pressure_scale, local);
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
  for (const GateColumn& column : gate_columns_) {
    BorderColumn border{column.nodes, column.values, 0};
    for (std::size_t k = 0; k < border.nodes.size(); ++k) {
      constraints_.project(border.nodes[k], border.values.data() + k * dim);
    }
    for (Real& value : border.values) value *= system_.pressure_scale;
    system_.borders.push_back(std::move(border));
  }
}

const LinearSystem& StokesOperator::tangent(const StokesState& state, bool newton) {
  if (!scale_is_chosen_) choose_scale();
  matrix_->start();
  with_element(mesh_->dim, geometry_,
               [&]<class Element>(std::type_identity<Element>) { add_element_matrices<Element>(state, newton); });
  if (!terms_.empty()) {
    const std::vector<Real> unknowns = unknowns_in_space(state);
    TangentSink sink(extended_constraints_, *matrix_);
    for (const ResidualTerm* term : terms_) term->add_tangent(*space_, unknowns, sink);
  }
  matrix_->finish(stiffness_);
  scale_borders();
  system_.comm = comm_;
  system_.mesh = mesh_;
  system_.matrix = matrix_->matrix();
  system_.constraints = &constraints_;
  system_.element_viscosity = viscosity_;
  system_.element_volume = volume_;
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
