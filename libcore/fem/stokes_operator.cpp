#include "fem/stokes_operator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "fem/element_loop.hpp"

namespace malleus {

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
  const bool any_gas = std::any_of(gates_.begin(), gates_.end(), [](const FluxGate& g) { return g.compliance > 0; });
  pressure_is_free_ = comm_->max(free) <= 1e-8 * comm_->max(largest) && !any_gas;
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

bool StokesOperator::is_at_rest(LocalId node) const {
  std::array<Real, 3> velocity = {1, 1, 1};
  constraints_.impose(node, velocity.data());
  return constraints_.fixed_directions(node) == mesh_->dim &&
         std::all_of(velocity.begin(), velocity.begin() + mesh_->dim, [](Real v) { return v == 0; });
}

void StokesOperator::find_still_elements() {
  still_.clear();
  if (!leaves_out_still_) return;
  for (LocalId e = 0; e < mesh_->elements(); ++e) {
    const auto nodes = mesh_->nodes_of_element(e);
    if (std::all_of(nodes.begin(), nodes.end(), [&](LocalId node) { return is_at_rest(node); })) still_.push_back(e);
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

/// A pocket pushes on what is around it as elements of the pressure one would.
void StokesOperator::add_void_column(const FluxGate& gate, std::vector<Real>& dense) const {
  with_element(mesh_->dim, geometry_, [&]<class Element>(std::type_identity<Element>) {
    constexpr int D = Element::dim;
    ElementUnknowns<D> uniform;
    uniform.pressure.setOnes();
    for (const LocalId e : gate.voids) {
      const ElementUnknowns<D> forces = Element(simplex_points<D>(*mesh_, e)).residual(uniform, 1, 1);
      const auto nodes = mesh_->nodes_of_element(e);
      for (int a = 0; a <= D; ++a) {
        Eigen::Map<Point<D>>(dense.data() + static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)]) * D) +=
            forces.velocity.col(a);
      }
    }
  });
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
  add_void_column(gate, dense);
  mesh_->node_halo.add_to_owners(dense, dim);
  GateColumn column;
  for (LocalId node = 0; node < mesh_->owned_nodes(); ++node) {
    const Real* value = dense.data() + static_cast<std::size_t>(node) * dim;
    if (is_at_rest(node) || std::all_of(value, value + dim, [](Real x) { return x == 0; })) continue;
    column.nodes.push_back(node);
    column.values.insert(column.values.end(), value, value + dim);
  }
  return column;
}

StokesState StokesOperator::start_state() const {
  StokesState state;
  state.nodes.assign(static_cast<std::size_t>(mesh_->nodes()) * (mesh_->dim + 1), 0.0);
  impose_constraints(state);
  const auto dim = static_cast<std::size_t>(mesh_->dim);
  for (std::size_t g = 0; g < gates_.size(); ++g) {
    if (gates_[g].flux == 0) continue;
    std::vector<Real> along = gate_columns_[g].values;
    Real through = 0;
    for (std::size_t k = 0; k < gate_columns_[g].nodes.size(); ++k) {
      constraints_.project(gate_columns_[g].nodes[k], along.data() + k * dim);
      for (std::size_t d = 0; d < dim; ++d) through += along[k * dim + d] * along[k * dim + d];
    }
    through = comm_->sum(through);
    if (!(through > 0)) continue;
    for (std::size_t k = 0; k < gate_columns_[g].nodes.size(); ++k) {
      Real* velocity = state.nodes.data() + static_cast<std::size_t>(gate_columns_[g].nodes[k]) * (dim + 1);
      for (std::size_t d = 0; d < dim; ++d) velocity[d] += gates_[g].flux / through * along[k * dim + d];
    }
  }
  if (!gates_.empty()) mesh_->node_halo.update_copies(state.nodes, mesh_->dim + 1);
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

void StokesOperator::update_viscosity(Real start_rate) {
  model_->start_rates(*mesh_, start_rate, shear_rate_);
  model_->evaluate(*mesh_, shear_rate_, viscosity_, slope_);
  leave_out_still();
}

void StokesOperator::update_viscosity(std::span<const Real> shear_rates) {
  shear_rate_.assign(shear_rates.begin(), shear_rates.end());
  model_->evaluate(*mesh_, shear_rate_, viscosity_, slope_);
  leave_out_still();
}

void StokesOperator::restore_viscosity(std::span<const Real> viscosity, std::span<const Real> shear_rate) {
  check(viscosity.size() == viscosity_.size() && shear_rate.size() == shear_rate_.size(), "a value an element");
  viscosity_.assign(viscosity.begin(), viscosity.end());
  shear_rate_.assign(shear_rate.begin(), shear_rate.end());
}

bool StokesOperator::is_linear() const {
  return !inertia_ && model_->is_linear() &&
         std::all_of(terms_.begin(), terms_.end(), [](const ResidualTerm* term) { return term->is_linear(); });
}

}  // namespace malleus
