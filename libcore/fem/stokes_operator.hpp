#pragma once

/// Residual and tangent of the Stokes equations on the mesh, with what acts on body and boundary.

#include <memory>
#include <optional>

#include "fem/facet.hpp"
#include "fem/inertia_element.hpp"
#include "fem/linear_system.hpp"
#include "fem/matrix_free_tangent.hpp"
#include "fem/residual_term.hpp"
#include "fem/stokes_mini.hpp"
#include "fem/system_matrix.hpp"
#include "fem/viscosity_model.hpp"

namespace malleus {

/// The unknowns of a scene.
struct StokesState {
  std::vector<Real> nodes;    ///< [local node][dim+1]: v_1..v_dim [m/s], p [Pa]; owned, then copies
  std::vector<Real> borders;  ///< [gate]: the pressure on it, Pa; the same on all ranks
};

/// Force per area on a facet, linear between its nodes.
struct FacetTraction {
  LocalId facet = 0;
  std::array<Real, 9> traction{};  ///< [node of the facet][dim], Pa
};

/// What acts from outside. Empty vectors act not at all.
struct StokesLoads {
  std::vector<Real> element_force;       ///< [element][dim], N/m^3: density times gravity, say
  std::vector<Real> node_force;          ///< [local node][dim], N/m^3, linear between; added to the former
  std::vector<Real> element_divergence;  ///< [element], 1/s: div v demanded (volume targets)
  std::vector<FacetTraction> tractions;
  /// [element], Pa: of what is in elements that are not modelled; where those meet modelled ones, -p n acts on these.
  std::vector<Real> void_pressure;
};

/// Facets, or the border of elements that are not modelled (a closed pocket), that share one unknown pressure q,
/// traction -q n, such that the flow through them is the demanded one: integral of v.n over all ranks' facets =
/// flux + compliance (q - reference), n out of what is modelled [m^3/s; negative = into the domain]. A pocket of gas at
/// p with volume V, asked for the pressure at the end of a step dt, has compliance V/(p dt) and reference p.
struct FluxGate {
  std::vector<LocalId> facets;
  Real flux = 0;
  std::vector<LocalId> voids = {};  ///< elements of this rank that are not modelled
  Real compliance = 0;              ///< m^3/(s Pa), >= 0
  Real reference = 0;               ///< Pa
};

/// Inertia of what flows: rho (dv/dt + v . grad v), dv/dt = rate v - history (see InertiaElement).
struct FlowInertia {
  std::vector<Real> density;  ///< [element], kg/m^3
  Real rate = 0;              ///< 1/s; 0: a steady flow
  std::vector<Real> history;  ///< [local node][dim], m/s^2; empty: none
};

/// Sizes against which residuals are judged; reduced over the ranks.
struct ResidualReport {
  Real norm = 0;        ///< of the scaled residual, borders included
  Real reference = 0;   ///< of the forces that must balance: assembled internal forces or loads, N
  Real internal = 0;    ///< of the assembled internal forces alone, N
  Real gate_error = 0;  ///< largest difference of a gate's flux from the demanded one, over the largest demanded
  Real relative() const { return reference > 0 ? norm / reference : norm; }
  /// Where the pressure is free: the net flow that the prescribed velocities demand, less the volume targets. It has
  /// been spread over the domain as a uniform div v. m^3/s, outward; 0 elsewhere.
  Real net_flow = 0;
};

/// What a matrix is the derivative of. `newton` is consistent, and then B of the lower left block also has how the
/// subscales follow the viscosity; `symmetric` leaves that out, for methods that rely on symmetry: Newton's method then
/// converges linearly in the end, by about 1/27 a step.
/// Of inertia, `newton` and `symmetric` have the whole derivative and `picard` that with the carrying velocity kept.
enum class Tangent { picard, symmetric, newton };

/// The node with the largest residual of force.
struct WorstNode {
  Real force = 0;               ///< N
  std::array<Real, 3> place{};  ///< m
};

/// The discrete equations of quasi-static flow, seed paper eq. [4] with
///
///     integral 2 eta(gamma) eps(v):eps(w) - p div w + terms = loads,   -integral q (div v - divergence) - C p = 0
///
/// by condensed P1+/P1 elements. Holds the constraints, the loads, the viscosity of each element and the matrix. The
/// communicator, the mesh, the model and the terms must outlive it; coordinates may move between calls.
class StokesOperator : private MatrixEntries {
 public:
  StokesOperator(const Communicator& comm, const Mesh& mesh, Geometry geometry);
  StokesOperator(const StokesOperator&) = delete;
  StokesOperator& operator=(const StokesOperator&) = delete;

  const Mesh& mesh() const noexcept { return *mesh_; }
  Geometry geometry() const noexcept { return geometry_; }
  const Communicator& comm() const noexcept { return *comm_; }

  void set_viscosity(const ViscosityModel& model) { model_ = &model; }
  void set_constraints(NodeConstraints constraints) { constraints_ = std::move(constraints); }
  const NodeConstraints& constraints() const noexcept { return constraints_; }
  void set_loads(StokesLoads loads) { loads_ = std::move(loads); }
  /// The Navier-Stokes equations in place of the Stokes equations: no potential, and no symmetric tangent.
  void set_inertia(FlowInertia inertia) { inertia_ = std::move(inertia); }
  bool has_inertia() const noexcept { return inertia_.has_value(); }
  void set_gates(std::vector<FluxGate> gates) { gates_ = std::move(gates); }
  void set_terms(std::vector<ResidualTerm*> terms) { terms_ = std::move(terms); }
  /// Whether elements all of whose nodes are held at rest leave the equations, as if they had no viscosity: nothing
  /// flows there, and their pressure, which the subscales alone determine, would cost iterations and mean nothing
  /// (sections one element thin). Their other pressures can be filled in by extend_pressure(). Default: they stay.
  void leave_out_still_elements(bool leave_out) { leaves_out_still_ = leave_out; }

  /// Whether tangents are kept by their products alone, where they can be: without terms, inertia and axis. Their
  /// entries are then made for as long as a preconditioner takes to read them. Default: they are assembled.
  void use_matrix_free(bool is_free) { wants_matrix_free_ = is_free; }
  bool is_matrix_free() const noexcept {
    return wants_matrix_free_ && terms_.empty() && !inertia_ && geometry_ == Geometry::plane;
  }

  /// To be called when constraints, loads, gates, terms or coordinates were set or changed: volumes, couplings,
  /// halo of the constraints; finds whether anything fixes the mean pressure. Elements of zero viscosity are left
  /// out, nodes that only they have are fixed at rest (or as the constraints say). Collective.
  void prepare();
  /// Nothing fixes the mean pressure (see LinearSystem).
  bool pressure_is_free() const noexcept { return pressure_is_free_; }
  /// Shifts pressures, with those of the gates, to zero mean over the modelled volume where the pressure is free.
  /// Collective.
  void remove_pressure_mean(StokesState& state) const;

  /// A state of zero velocities and pressures that satisfies the constraints, and lets the demanded flux through the
  /// nodes of each gate: against the forces that this makes a linear solver's tolerance is to be judged, as against
  /// those of prescribed velocities. Collective.
  StokesState start_state() const;
  /// Puts the prescribed velocities into a state, and the right number of borders. Local.
  void impose_constraints(StokesState& state) const;

  /// Viscosities of the elements at the state's shear rates, at the model's start_rates() for one [1/s], or at given
  /// ones [element]. Local.
  void update_viscosity(const StokesState& state);
  void update_viscosity(Real start_rate);
  void update_viscosity(std::span<const Real> shear_rates);
  /// Viscosities and shear rates that an update gave before, on the same mesh, [element]. Local.
  void restore_viscosity(std::span<const Real> viscosity, std::span<const Real> shear_rate);
  std::span<const Real> viscosity() const noexcept { return viscosity_; }    ///< [element], Pa.s
  std::span<const Real> shear_rate() const noexcept { return shear_rate_; }  ///< [element], of the last update, 1/s
  std::span<const Real> volume() const noexcept { return volume_; }          ///< [element], m^3 (ring)
  bool is_linear() const;                                                    ///< one linear solve is exact
  bool has_terms() const noexcept { return !terms_.empty(); }
  /// How the terms take their branches from here on; hold: those of this state. Collective.
  void choose_branches(Branches choice, const StokesState& state);
  Real sensitivity() const { return model_->sensitivity(); }

  /// The residual at the current viscosities, scaled and projected as LinearSystem says (the right side of a step is
  /// its negative). Collective.
  ResidualReport residual(const StokesState& state, LinearVector& result);
  /// The matrix at the current viscosities, which must stay as they are while a matrix-free one is used. Collective.
  const LinearSystem& tangent(const StokesState& state, Tangent kind);
  /// Adds a factor times the step's velocities, and another times its pressures and borders, scales undone; copies
  /// updated. Collective.
  void add_step(const LinearVector& step, Real velocity_factor, Real pressure_factor, StokesState& state) const;
  /// Power of the momentum residual over the velocities of a step, both of residual() or a linear solve: W. Collective.
  Real residual_power(const LinearVector& residual, const LinearVector& step) const;

  /// Forces that the constraints exert on the material [N], [owned node][dim]: the unprojected residual with loads and
  /// terms, zero at free nodes to the solver's tolerance. Exact: their power is that of the discrete solution.
  /// Collective.
  std::vector<Real> reactions(const StokesState& state);
  /// Power dissipated by the viscous stress [W], that of the subscales (pressure times C times pressure) included:
  /// equal to the power of loads and constraints. At the current viscosities. Collective.
  Real dissipation(const StokesState& state) const;
  /// Mean velocity of each element's subscales (see MiniElement), [element][dim], m/s; zero where nothing is modelled.
  /// What flows through an element is the velocity at its nodes and this. At the current viscosities. Local.
  std::vector<Real> subscale_velocity(const StokesState& state) const;
  /// Mean force of each element's loads, [element][dim], N/m^3; empty where none acts inside. Local.
  std::vector<Real> force_density() const;
  /// Of a result of residual(). Collective.
  WorstNode worst_node(const LinearVector& residual) const;

 private:
  /// Nodal sums, [node of the space][dim+1] (N, m^3/s): of the elements' stresses, and of what stands against them.
  struct Balance {
    std::vector<Real> internal;
    std::vector<Real> external;
    Real roundoff = 0;  ///< square of the forces below which rounding rules, N^2
  };
  struct GateColumn {
    std::vector<LocalId> nodes;  ///< owned, increasing
    std::vector<Real> values;    ///< integral of phi n, [node][dim], m^2
  };

  void compute_volumes();
  void find_still_elements();
  void leave_out_still();
  void fix_unmodelled_nodes();
  void choose_scale();
  void find_pressure_null();
  Real remove_net_flow(LinearVector& residual) const;
  GateColumn gate_column(const FluxGate& gate) const;
  void add_void_column(const FluxGate& gate, std::vector<Real>& dense) const;
  bool is_at_rest(LocalId node) const;
  std::vector<Real> unknowns_in_space(const StokesState& state) const;
  Balance balance(const StokesState& state);
  template <class Element>
  void add_elements(std::span<const Real> unknowns, Balance& sums) const;
  template <class Element>
  ElementLoad<Element::dim> element_load(LocalId element) const;
  template <int D>
  InertiaElement<D> inertia_of(LocalId element, const ElementUnknowns<D>& unknowns) const;
  template <int D>
  void add_tractions(Balance& sums) const;
  template <class Element>
  void add_void_pressure(Balance& sums) const;
  void judge_gates(const StokesState& state, LinearVector& result, ResidualReport& report) const;
  void add_terms(std::span<const Real> unknowns, Balance& sums) const;
  template <class Element>
  void add_element_matrices(const StokesState& state, Tangent kind);
  void scale_borders();
  void assemble_matrix(const StokesState& state, Tangent kind);
  void make_matrix_free(const StokesState& state, Tangent kind);
  Mat assemble() override;
  void release() override;

  const Communicator* comm_;
  const Mesh* mesh_;
  Geometry geometry_;
  const ViscosityModel* model_ = nullptr;
  NodeConstraints constraints_;
  NodeConstraints extended_constraints_;
  StokesLoads loads_;
  std::optional<FlowInertia> inertia_;
  std::vector<Real> inertia_rate_;  ///< [element] density times rate, kg/(m^3 s)
  std::vector<FluxGate> gates_;
  std::vector<ResidualTerm*> terms_;
  bool pressure_is_free_ = false;

  bool leaves_out_still_ = false;
  std::vector<LocalId> still_;  ///< elements that leave the equations

  NodeTuples tuples_;
  std::unique_ptr<NodeSpace> space_;
  std::unique_ptr<SystemMatrix> matrix_;  ///< null where none is assembled
  bool wants_matrix_free_ = false;
  std::unique_ptr<MatrixFreeTangent> products_;
  StokesState linearized_;  ///< where a matrix-free tangent is taken
  Tangent linearized_kind_ = Tangent::picard;
  LinearSystem system_;
  Real length_ = 1;     ///< of a typical element, m
  Real stiffness_ = 1;  ///< eta h^(dim-2), of the size of A's entries
  bool scale_is_chosen_ = false;
  std::vector<Real> node_volume_;  ///< [owned node] integral of phi over what is modelled, m^3; where pressure is free
  std::vector<GateColumn> gate_columns_;
  std::vector<Real> volume_;
  std::vector<Real> shear_rate_;
  std::vector<Real> viscosity_;
  std::vector<Real> slope_;
};

}  // namespace malleus
