#pragma once

/// The shares of the ranks kept even during a run, as [partition] asks.

#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "case/run_sections.hpp"
#include "engine/component.hpp"
#include "field/field.hpp"
#include "partition/partition.hpp"

namespace malleus {

/// What a process lends to its rebalancing.
struct RebalancedScene {
  const Communicator* comm = nullptr;
  Mesh* mesh = nullptr;
  FieldStore* fields = nullptr;
  /// Elements have moved between ranks, fields with them: what is built on the mesh is to be built anew. Collective.
  std::function<void()> mesh_moved;
  /// What exchanges data beside the mesh, contact pairs for one; may be empty. Collective.
  std::function<std::vector<NodeCoupling>()> couplings;
};

/// Elements per second of this rank's processor as it is now: the best of a few passes over its elements' geometry. 0
/// where it has none. Local.
Real measure_element_rate(const Mesh& mesh);

/// Stands before the solves, behind a remesh. `counted` looks at the shares in a run's first increment and where the
/// mesh is another one, by the work that elements and nodes cost; `measured` in each increment, by the speeds at which
/// the processors go over their elements (then the bytes of two runs differ). Elements move only where F
/// (partition_cost()) falls by more than 0.5 %, by measured speeds 2 %, and by more than moving them costs. The log
/// says what is expected, and after three increments what came of it.
class Rebalancing final : public Component {
 public:
  /// Whether a run wants it: shares along the curve that are counted stay as they are.
  static bool is_wanted(const PartitionSettings& settings, const Communicator& comm) {
    return comm.size() > 1 && (settings.method != PartitionMethod::curve || settings.balance == Balance::measured);
  }

  Rebalancing(const PartitionSettings& settings, RebalancedScene scene);

  std::string name() const override { return "balance"; }
  std::string purpose() const override;
  Outcome advance(const Increment& increment) override;
  /// The shares stay: they hold the same state.
  void roll_back() override {}

  GlobalId times() const noexcept { return times_; }  ///< elements were moved so often

  /// For checkpoints. The same on all ranks.
  nlohmann::json save() const;
  void restore(const nlohmann::json& state);

 private:
  bool is_measured() const { return settings_.balance == Balance::measured; }
  bool update_speeds();
  void repartition(const Increment& increment);
  void tell_gain(const Increment& increment);

  PartitionSettings settings_;
  RebalancedScene scene_;
  std::vector<Real> speeds_;     ///< [rank] in force, mean 1
  std::vector<Real> smoothed_;   ///< [rank] measured, damped
  int increments_apart_ = 0;     ///< in a row in which the two differed
  GlobalId elements_seen_ = -1;  ///< of the mesh when it was last looked at
  GlobalId last_increment_ = 0;
  GlobalId times_ = 0;
  Real last_start_s_ = 0;           ///< wall clock
  std::vector<Real> increments_s_;  ///< wall times of the last increments, at most three
  Real before_s_ = 0;               ///< mean of those before the last move; 0 where nothing is to be told
  Real expected_gain_ = 0;
};

}  // namespace malleus
