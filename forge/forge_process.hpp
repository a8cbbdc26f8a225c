#pragma once

/// The forging process as the engine runs it.

#include <optional>

#include "engine/process.hpp"
#include "engine/rebalancing.hpp"
#include "engine/remeshing.hpp"
#include "forge/folds.hpp"
#include "forge/heat.hpp"
#include "forge/increment_errors.hpp"
#include "forge/known_errors.hpp"
#include "forge/motion.hpp"

namespace malleus::forge {

class ForgeProcess final : public Process {
 public:
  /// Takes the scene of the case; the case must outlive it.
  ForgeProcess(const ForgeCase& forge_case, std::unique_ptr<Scene> scene);

  const Mesh& mesh() const override { return scene_->mesh; }
  FieldStore& fields() override { return scene_->fields; }
  std::vector<Component*> components() override;
  std::vector<LeftOut> left_out() const override;
  std::vector<std::string> suggestions() const override;
  std::vector<std::string> accuracy_settings() const override;
  Forecast forecast() const override;
  std::vector<std::string> output_fields() const override;
  Real largest_step() override;
  std::optional<std::string> finished() override;
  std::vector<Real> results() override;
  Real progress() override {
    return case_.time.stroke && *case_.time.stroke > 0 ? leading_stroke().value_or(0) / *case_.time.stroke : 0;
  }
  void refresh_outputs() override;
  std::vector<std::string> history_columns() const override;
  std::vector<HistoryCell> history_row() override;
  Real volume() const override;
  Probes* probes() override { return probes_ ? &*probes_ : nullptr; }
  std::string increment_note() const override;
  LinearTotals linear_totals() const override;
  nlohmann::json accuracy() override;
  std::vector<std::string> closing_lines() override;
  ErrorBudget error_budget() override;
  void stand_as_it_is(Real size_ratio) override;
  nlohmann::json save_state() const override;
  std::vector<Real> save_local() const override { return flow_.save_memory(); }
  void restore_local(std::span<const Real> saved) override { flow_.restore_memory(saved); }
  void restore(Mesh&& mesh, std::vector<std::pair<FieldSpec, std::vector<Real>>>&& fields,
               const nlohmann::json& state) override;

 private:
  /// One that history.csv gives the force and stroke of.
  struct Opponent {
    enum class Kind { tool, body, boundary };
    Kind kind = Kind::tool;
    std::size_t index = 0;
    std::string name;
  };
  std::vector<Opponent> opponents() const;
  Vector force_on(const Opponent& opponent) const;
  Real stroke_of(const Opponent& opponent) const;
  std::optional<Real> leading_stroke() const;
  std::optional<std::string> stalled() const;
  Real leading_speed() const;
  Real planned_strain() const;
  Real volume_step() const;
  Real volume_change() const;
  RebalancedScene rebalanced_scene();
  bool has_filling(const Opponent& opponent) const;
  std::vector<HistoryCell> contact_cells(const Opponent& opponent) const;
  Real mean_strain_rate() const;
  void sum_up_increment();
  RemeshedScene remeshed_scene();
  void mesh_changed();

  const ForgeCase& case_;
  std::unique_ptr<Scene> scene_;
  std::optional<Probes> probes_;
  ContactFlow flow_;
  std::optional<Remeshing> remeshing_;
  std::optional<Rebalancing> rebalancing_;
  std::optional<KnownErrors> errors_;
  std::optional<TracerMotion> tracers_;
  std::optional<Heat> heat_;
  FoldWatch folds_;
  Motion motion_;
  int last_newton_ = 0;
  Real last_stroke_ = 0;      ///< m, of the leading tool or boundary
  int at_rest_ = 0;           ///< increments since it last advanced
  Real max_penetration_ = 0;  ///< of the run, m
  Real max_imbalance_ = 0;
  ForceErrorSums force_errors_;
  Real largest_strain_step_ = 0;  ///< mean over the bodies
  Real last_time_ = 0;            ///< s, of the last row
  WorkBalance work_;              ///< J, of the run
  GlobalId newton_total_ = 0;
  GlobalId increments_ = 0;
};

}  // namespace malleus::forge
