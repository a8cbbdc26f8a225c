#pragma once

/// The mesh made anew during a run, as [remesh] asks: when, and to which sizes.

#include <functional>
#include <nlohmann/json.hpp>

#include "case/run_sections.hpp"
#include "engine/component.hpp"
#include "field/field.hpp"
#include "remesh/distributed.hpp"

namespace malleus {

/// What a process lends to its remeshing.
struct RemeshedScene {
  const Communicator* comm = nullptr;
  Mesh* mesh = nullptr;
  FieldStore* fields = nullptr;
  std::string flow_field;          ///< node field by whose error `nodes` and `error` set sizes
  std::vector<char> kept_regions;  ///< [region] 1: no element of it changes; may be empty
  bool balances_by_cost = false;   ///< [partition] method = cost
  bool keep_volume = false;        ///< restore each region's volume where a curved surface was resampled
  /// Makes the metric finer where the process wants it, within bounds that hold afterwards; may be empty. Collective.
  std::function<void(Metric&)> refine;
  /// Whether the process wants a new mesh now, quality apart; may be empty. Collective.
  std::function<bool(const Increment&)> asks;
  /// Readies the fields for their transfer; may be empty. Collective.
  std::function<void()> before;
  /// Everything built on the mesh is to be built anew. Collective.
  std::function<void()> mesh_changed;
  /// After a remesh that succeeded, before mesh_changed(): may move nodes of the new mesh.
  std::function<void()> made_anew = {};
};

/// Stands first among the components: the increment is solved on the new mesh. The mesh is made anew every N
/// increments, or (auto) when its worst elements or its edge lengths ask for it; with any setting also before elements
/// become too flat to be solved on, and in the first increment where the input does not have the wanted sizes.
class Remeshing final : public Component {
 public:
  Remeshing(const RemeshSettings& settings, RemeshedScene scene);

  std::string name() const override { return "remeshing"; }
  std::string purpose() const override;
  FieldUse uses() const override { return {{}, {}, {}}; }
  /// Where no sound new mesh comes about the outcome is `failed`, and mesh and fields are those of before.
  Outcome advance(const Increment& increment) override;
  /// The new mesh stays: it holds the same state.
  void roll_back() override {}

  /// Whether the mesh of the last increment was new in it.
  bool remeshed() const noexcept { return remeshed_in_ == last_increment_; }
  GlobalId times() const noexcept { return times_; }

  /// For checkpoints: what decides the next remesh. The same on all ranks.
  nlohmann::json save() const { return {{"quality_after", quality_after_}, {"times", times_}}; }
  void restore(const nlohmann::json& state) {
    quality_after_ = state.at("quality_after");
    times_ = state.at("times");
  }

 private:
  class Backup;

  bool follows_error() const { return settings_.nodes || settings_.error; }
  Metric wanted_metric() const;
  Metric base_metric() const;
  bool is_due(const Increment& increment, const MetricFit& fit) const;
  Outcome remesh(const Increment& increment, const Metric& metric);

  RemeshSettings settings_;
  RemeshedScene scene_;
  Real quality_after_ = 1;  ///< worst of the last remesh
  GlobalId times_ = 0;
  GlobalId last_increment_ = 0;
  GlobalId remeshed_in_ = -1;
};

}  // namespace malleus
