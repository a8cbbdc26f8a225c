#pragma once

/// The front component: moves the fluids with the flow.

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "engine/component.hpp"
#include "inject/filling_state.hpp"
#include "inject/front_set.hpp"
#include "inject/traced_front.hpp"
#include "solvers/level_set_transport.hpp"
#include "solvers/level_set_wetting.hpp"

namespace malleus::inject {

/// Transports each level set with the flow (paper, eq. [11]), lets it follow the walls, keeps it a distance, and gives
/// it the volume that came through the boundary. Each increment is divided so that the front crosses at most
/// [front] cfl of an element at a time. Fields: the level sets; fill_time [s]: when the front passed, -1 ahead of it.
class Front final : public Component {
 public:
  /// fronts: where they start, see FrontSet::set_initial(). renew_velocity(time): brings the velocity field to that
  /// time; empty for a flow that is kept over an increment.
  Front(Scene& scene, FrontSet& fronts, FillingState& state, std::function<void(Real)> renew_velocity);

  std::string name() const override { return "front"; }
  std::string purpose() const override;
  FieldUse uses() const override;
  void start() override;
  Outcome advance(const Increment& increment) override;
  void roll_back() override;

  /// After the mesh and the fields were replaced. Collective.
  void rebuild();
  /// Before a remesh: fill_time goes on ahead of the fronts, so that interpolation finds no jump there.
  void prepare_remesh();
  /// After a remesh and rebuild(): fronts get their volumes back. Collective.
  void finish_remesh();

  /// Elements a second through which the fluid at the front flows, at the fastest place: limits substeps. Collective.
  Real rate();
  /// Elements a second that the front as a whole moves on at the present flow: what the flow follows. Collective.
  Real crossing_rate() const;
  int substeps() const { return substeps_; }                   ///< of the last increment
  GlobalId redistances() const { return redistances_; }        ///< since the start
  GlobalId pockets_filled() const { return pockets_filled_; }  ///< too small for the mesh; since the start
  GlobalId blocked_nodes() const { return wetting_->nodes_without_interior(); }
  nlohmann::json save() const;
  void load(const nlohmann::json& saved);

 private:
  /// What the boundary does to one fluid.
  struct Exchange {
    Real entering = 0;  ///< m^3/s, through any part of the boundary
    Real leaving = 0;   ///< m^3/s
  };
  Exchange exchange(std::size_t front) const;
  ImposedLevelSet imposed(std::size_t front, Real dt) const;
  std::vector<char> wetted_nodes() const;
  std::vector<char> open_nodes() const;
  std::vector<char> kept_apart(std::size_t front) const;
  void restore_volumes();
  void warn_of_backflow();
  Real substep_rate();
  Outcome substep(Real start, Real dt);
  Outcome advance_traced(const Increment& increment);
  void mark_fill_time(const std::vector<Real>& before, Real start, Real dt);
  void snapshot();

  Scene& scene_;
  FrontSet& fronts_;
  FillingState& state_;
  std::function<void(Real)> renew_velocity_;
  std::unique_ptr<LevelSetTransport> transport_;
  std::unique_ptr<WallWetting> wetting_;
  std::optional<TracedFront> traced_;  ///< with transport = trace
  std::vector<Real> targets_;          ///< volume of each fluid, m^3
  int substeps_ = 0;
  GlobalId redistances_ = 0;
  GlobalId pockets_filled_ = 0;
  bool warned_of_backflow_ = false;
  std::vector<char> open_;  ///< [node], where air can come in or go out

  std::vector<std::vector<Real>> saved_level_sets_;  ///< before the increment, for roll_back()
  std::vector<Real> saved_fill_time_;
  std::vector<Real> saved_targets_;
  FillingState saved_state_;
};

}  // namespace malleus::inject
