#pragma once

/// From surfaces, tools and bodies to contact points.

#include <optional>

#include "forge/contact_term.hpp"
#include "forge/pair_search.hpp"
#include "forge/tool.hpp"

namespace malleus::forge {

/// A contact between deformable bodies, resolved: who is slave, who is master.
struct BodyPair {
  std::string name;
  std::int32_t slave = 0;   ///< region
  std::int32_t master = 1;  ///< region
  FrictionSpec friction;
  std::optional<Real> penalty;  ///< c of this contact; else the scene's
};

/// What contact needs to know of a body.
struct BodyScale {
  bool is_deformable = true;
  Real consistency = 0;  ///< K, Pa.s^m: scale of Norton's friction
  Real viscosity = 0;    ///< at the scene's reference rate, Pa.s
  Real edge = 0;         ///< mean edge of its surface, m
  bool is_held = true;   ///< some boundary condition holds it: no help against rigid motion is wanted
};

struct ContactSettings {
  Real penalty = 1e4;   ///< c: r = c viscosity / edge of the slave
  Real slip_scale = 0;  ///< regularisation of friction, m/s
  Real holding_friction =
      0;  ///< where friction is 0 and the slave is not held: f K of linear friction = this x viscosity/edge
  bool closes_gaps = true;  ///< false: what holds keeps the gap or overlap that it has
};

/// Where the nodes are expected at the end of the increment, if they go with the guessed velocity.
struct Prediction {
  std::vector<Vector> positions;   ///< [local node]
  std::vector<Vector> velocities;  ///< [local node] the guess, m/s
  Real effective_step = 0;         ///< d position / d velocity, s
  Real largest_motion = 0;         ///< of any node or tool in the increment, m; the same on all ranks
};

/// What the last solve left at a slave node against an opponent.
struct ContactMemory {
  LocalId slave = -1;
  int opponent = 0;
  Vector normal = Vector::UnitX();
  Real multiplier = 0;  ///< Pa
  Real pressure = 0;    ///< Pa
};

struct ContactScene {
  const FreeSurface* surface = nullptr;
  std::vector<Tool>* tools = nullptr;
  std::span<const BodyPair> pairs;
  std::span<const BodyScale> bodies;      ///< [region]
  std::span<const Real> shear_stress;     ///< [local node] of the last known state, Pa; may be empty: unlimited
  std::span<const Real> softening;        ///< [local node] of the consistency; empty: none softens
  std::span<const ContactMemory> memory;  ///< sorted by slave, opponent
  /// [local node] Pa, where the memory was lost (a restart, another mesh): nodes that are near an opponent, most of
  /// them under pressure, are taken to hold. Empty: the memory is right.
  std::span<const Real> last_pressure;
  std::span<const Real> mean_pressure;  ///< [region] Pa, of the nodes under pressure, on all ranks; with last_pressure
  ContactSettings settings;
};

/// All contact points of this rank's slave nodes, sorted by node and opponent. Candidates are the nodes that may touch
/// in this increment; the positive part in the pressure decides. Tools: their pose at the end of the increment.
/// Collective.
std::vector<ContactPoint> find_contacts(const Communicator& comm, const ContactScene& scene,
                                        const Prediction& prediction);

}  // namespace malleus::forge
