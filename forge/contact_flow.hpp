#pragma once

/// The velocity and pressure of the bodies, with what holds and pushes them.

#include <functional>

#include "engine/component.hpp"
#include "forge/initial_contact.hpp"
#include "forge/scene.hpp"
#include "solvers/newton.hpp"

namespace malleus::forge {

/// Who does work on the bodies and where it goes: imposed + tools + loads = deformation + contact. Powers at an
/// increment's solve [W], or their sums over a run [J].
struct WorkBalance {
  Real imposed = 0;      ///< by velocities on boundaries
  Real tools = 0;        ///< by tools, on the bodies
  Real deformation = 0;  ///< of the viscous stress
  Real contact = 0;      ///< of friction, and of what the penalty lets through
};

/// What an increment's solves took and left, for history.csv.
struct FlowReport {
  int newton_iterations = 0;            ///< of the solve that gives forces and fields
  int midpoint_iterations = 0;          ///< of the one at the middle, where Runge-Kutta makes the step
  std::vector<Vector> tool_forces;      ///< [tool] N, on it
  std::vector<Vector> body_forces;      ///< [region] N, on it as a master
  std::vector<Vector> boundary_forces;  ///< [boundary] N, on what imposes it
  std::vector<Real> contact_areas;      ///< [tool, then pair] m^2 under pressure
  WorkBalance power;
  Real force_imbalance = 0;  ///< sum of the forces that are left over, relative to the largest one
  Real max_penetration = 0;  ///< m, at the end of the increment as the conditions see it
  Real penalty_power = 0;    ///< W, of the contact pressures on what they let through
  Real lost_power = 0;       ///< W, of those pressures on what the penalties give way, approach left out
  Real residual = 0;         ///< relative, that the last nonlinear solve ended with
  int contacts = 0;          ///< active contact points
};

/// A surface node that touches what it faced in an increment's solve, for the heat that crosses and that friction
/// makes.
struct Touching {
  std::size_t surface = 0;  ///< its place in FreeSurface::nodes()
  LocalId slave = -1;
  int opponent = 0;   ///< tools first, then pairs of bodies
  Real area = 0;      ///< m^2
  Real friction = 0;  ///< power of friction, W/m^2
  std::array<GlobalId, 3> masters = {-1, -1, -1};
  std::array<Real, 3> weights = {0, 0, 0};
};

/// Totals of a run.
struct FlowTotals {
  GlobalId linear_solves = 0;
  GlobalId linear_iterations = 0;
  GlobalId linear_failures = 0;
  Real assembly_seconds = 0;
  Real setup_seconds = 0;
  Real solve_seconds = 0;
};

/// Paper, eq. [5] to [7]: Stokes flow of the bodies under contact and friction with tools and with each other. Writes
/// velocity, pressure, viscosity and strain rate, and the velocity by which the mesh goes in this increment.
class ContactFlow final : public Component {
 public:
  explicit ContactFlow(Scene& scene);

  std::string name() const override { return "flow"; }
  std::string purpose() const override;
  FieldUse uses() const override;
  void start() override { report_clearances(scene_); }
  Outcome advance(const Increment& increment) override;
  void roll_back() override;
  Outcome solve_once() override;

  const FlowReport& report() const noexcept { return report_; }
  const FlowTotals& totals() const noexcept { return totals_; }
  /// Of the last solve: points under pressure, and those whose gap is closed.
  const std::vector<Touching>& touching() const noexcept { return touching_; }
  /// Whether advance() fills the stress field, of the same state and mesh as velocity and pressure.
  void set_keeps_stress(bool keeps) { keeps_stress_ = keeps; }
  /// Nothing fixed the mean pressure of the last solve.
  bool pressure_is_free() const { return operator_->pressure_is_free(); }
  /// How the increment ends by the velocity of its solve.
  const Displacement& displacement() const noexcept { return displacement_; }
  /// Drops what belongs to the old mesh. Collective.
  void mesh_changed();
  /// The same after a remesh, where the fields are interpolated: the next solve starts from the strain rates of the old
  /// mesh, which do not have the noise of interpolated velocities. Collective.
  void remeshed();
  /// The largest rate at which an edge or an element of the last solution strains, 1/s; 0 before the first.
  Real largest_edge_rate() const noexcept { return edge_rate_; }
  Real largest_strain_rate() const noexcept { return strain_rate_; }
  /// What the last solve left at the contact points, as numbers, and back after a restart on as many ranks. Local.
  std::vector<Real> save_memory() const;
  void restore_memory(std::span<const Real> saved);
  void set_rates(Real edge_rate, Real strain_rate) {  ///< after a restart
    edge_rate_ = edge_rate;
    strain_rate_ = strain_rate;
  }
  /// Smallest distance of a moving tool to the bodies over its speed [s]: the time until something happens where
  /// nothing is pushed yet. Infinite where no tool moves. Collective.
  Real time_to_touch(Real time);

 private:
  /// One solve of an increment.
  struct Stage {
    Real start_time = 0;        ///< s, of the increment
    Real time = 0;              ///< s, at which velocities and loads are imposed
    Displacement displacement;  ///< how the increment ends
    std::vector<Real> start;    ///< [local node][dim] coordinates at the increment's start, m
    std::vector<Real> before;   ///< [local node][dim] velocity of the increment before, m/s
  };
  /// What roll_back() needs.
  struct Saved {
    std::vector<std::vector<Real>> fields;
    std::vector<ContactMemory> memory;
    std::vector<PressState> presses;
    std::vector<Real> targets;
    std::vector<Real> asked;
    FlowReport report;
    Real edge_rate = 0;
    Real strain_rate = 0;
    bool was_pushed = false;
  };

  void save();
  Outcome run_stages(const Increment& increment);
  Outcome check_room(Real time) const;
  Outcome check_blows(Real dt) const;
  Outcome run_midpoint(const Increment& increment, const Stage& first);
  Outcome solve_under_presses(Stage& stage);
  bool any_press(const std::function<bool(const Press&)>& is) const;
  bool accept_forces(Stage& stage, Real tolerance);
  bool stop_presses(Real time);
  void start_again(Real time);
  Outcome solve(const Stage& stage);
  Outcome solve_contacts(const Stage& stage, const FreeSurface& surface);
  Prediction predict(const Stage& stage) const;
  void find_points(const Stage& stage, const FreeSurface& surface);
  std::vector<Real> mean_contact_pressure(const FreeSurface& surface) const;
  bool is_pushed(Real time) const;
  void rest();
  void prepare_operator(const Stage& stage);
  Outcome run_newton(Real tolerance);
  std::vector<Real> shear_rates() const;  ///< [element] 1/s, of the strain_rate field
  NewtonOutcome run_newton_once(const NewtonOptions& asked);
  Outcome run_picard(Real tolerance);
  Real driving_speed(Real time) const;
  void volume_targets(const Stage& stage, StokesLoads& loads);

  /// Slips of the contact points at the solution, and from them pressures, gaps and what is remembered. Whether the
  /// solution asks for another pass (augmentation; limits of friction that moved). Collective.
  bool update_contacts(const Stage& stage, const FreeSurface& surface, int pass);
  /// The first part of that: slips, tractions, gaps, memory. The deepest penetration, as a share of an edge.
  /// Collective.
  Real measure_contacts(const Stage& stage, const FreeSurface& surface);
  bool update_friction(const FreeSurface& surface);
  Outcome guess_limits(const Stage& stage, const FreeSurface& surface);
  bool update_rubbing(int pass);
  /// Largest depth at which a node ends within a tool that its linearised gap did not foresee, in edges. Collective.
  Real surprise(const Stage& stage, const FreeSurface& surface);
  void note_touching(const Stage& stage, const FreeSurface& surface);
  void measure_forces();
  void measure_powers(std::span<const Real> reactions);
  void store_fields();
  void measure_rates();
  Vector position_at_end(const Stage& stage, LocalId node) const;
  Vector velocity_of(LocalId node) const;
  std::vector<Real> nodal_shear_stress() const;
  const FrictionSpec& friction_of(int opponent) const;
  bool has_limited_friction() const;

  Scene& scene_;
  std::unique_ptr<StokesOperator> operator_;
  StokesLinearSolver linear_;
  ContactTerm contact_;
  StokesState state_;
  std::vector<ContactMemory> memory_;         ///< sorted by slave, opponent
  std::vector<ContactTraction> tractions_;    ///< [contact point] at the solution
  std::vector<Vector> slips_;                 ///< [contact point] m/s, likewise
  std::vector<Real> gaps_;                    ///< [contact point] m, at the end of the increment
  std::unique_ptr<NodeSpace> contact_space_;  ///< with the masters of this rank's slaves
  std::vector<Touching> touching_;
  bool has_contacts_ = false;  ///< on any rank
  bool keeps_stress_ = true;
  bool is_transferred_ = false;  ///< the first guess comes from another mesh
  bool is_cold_ = true;          ///< no solution tells Newton's method where to start
  Displacement displacement_;
  Real tolerance_ = 0;  ///< of Newton's method, relative
  GlobalId tried_increment_ = -1;
  int tries_ = 0;  ///< of that increment
  FlowReport report_;
  FlowTotals totals_;
  Saved saved_;
  Real edge_rate_ = 0;
  Real strain_rate_ = 0;
};

/// Stress of each element by the fields, on the mesh that they were solved on: 2 viscosity strain rate - mean pressure,
/// xx yy xy, or xx yy zz xy yz xz, Pa. Local.
void compute_stress(const Scene& scene, std::span<Real> stress);

}  // namespace malleus::forge
