#pragma once

/// The filling of a cavity as the engine runs it.

#include <memory>

#include "engine/process.hpp"
#include "engine/rebalancing.hpp"
#include "engine/remeshing.hpp"
#include "inject/filling.hpp"
#include "inject/flow.hpp"
#include "inject/front.hpp"
#include "inject/thin_sections.hpp"

namespace malleus::inject {

/// A scene with the components that its case needs; assemble.hpp says which, and in which order they run.
class FillingProcess final : public Process {
 public:
  FillingProcess(const Communicator& comm, Mesh mesh, const InjectCase& settings);

  /// @name Parts, for assemble()
  /// @{
  void add_remeshing();
  void add_flow();
  void add_prescribed_flow();
  /// Throws InputError where the scene cannot start. Call it after all parts were added. Collective.
  void check_start();
  void add_front();
  void add_filling();
  bool has_fronts() const { return fronts_.size() > 0; }
  /// @}

  const Mesh& mesh() const override { return scene_.mesh; }
  FieldStore& fields() override { return scene_.fields; }
  std::vector<Component*> components() override { return order_; }
  std::vector<LeftOut> left_out() const override;
  std::vector<std::string> suggestions() const override;
  std::vector<std::string> accuracy_settings() const override;
  Forecast forecast() const override;
  std::vector<std::string> output_fields() const override;
  void refresh_outputs() override;
  ErrorBudget error_budget() override;
  Real largest_step() override;
  std::optional<std::string> finished() override;
  std::vector<Real> results() override;
  void solve_all_next() override;
  bool solves_again() const override;
  bool steps_follow_sizes() const override { return has_fronts(); }
  Real progress() override { return filling_ ? state_.filled / scene_.cavity : 0; }
  std::vector<std::string> history_columns() const override;
  std::vector<HistoryCell> history_row() override;
  Real volume() const override { return scene_.cavity; }
  std::string increment_note() const override;
  LinearTotals linear_totals() const override;
  nlohmann::json accuracy() override;
  std::vector<std::string> closing_lines() override;
  nlohmann::json save_state() const override;
  std::vector<Real> save_local() const override { return flow_ ? flow_->save_local() : std::vector<Real>(); }
  void restore_local(std::span<const Real> saved) override {
    if (flow_) flow_->load_local(saved);
  }
  void restore(Mesh&& mesh, std::vector<std::pair<FieldSpec, std::vector<Real>>>&& fields,
               const nlohmann::json& state) override;
  Probes* probes() override { return probes_ ? probes_.get() : nullptr; }

 private:
  Real power_of_pressures() const;
  void rebuild();
  nlohmann::json known_errors();
  std::vector<std::string> error_columns() const;
  Real stride() const;
  bool has_gas() const;

  Scene scene_;
  FrontSet fronts_;
  FillingState state_;
  std::unique_ptr<Mixture> mixture_;
  std::unique_ptr<Remeshing> remeshing_;
  std::unique_ptr<Rebalancing> rebalancing_;
  std::unique_ptr<Flow> flow_;
  std::unique_ptr<PrescribedFlow> prescribed_;
  std::unique_ptr<Front> front_;
  std::unique_ptr<Filling> filling_;
  std::unique_ptr<Probes> probes_;
  std::vector<Component*> order_;
  ThinSections thin_;
  Real way_ = 0;  ///< that the fronts had before them at the start, m
};

/// The thickest fluid's viscosity over the thinnest that is modelled as it is given.
Real allowed_contrast(const InjectCase& settings);

}  // namespace malleus::inject
