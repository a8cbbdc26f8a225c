#include "engine/engine.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "base/error.hpp"
#include "base/log.hpp"
#include "storage/atomic_file.hpp"
#include "support/box_mesh.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::ScratchDirectory;
using test::world;

/// dy/dt = -y by explicit Euler in a field; refuses steps above a limit, and fails for good after a time.
class Decay : public Component {
 public:
  Decay(const Mesh& mesh, FieldStore& fields) : y_(fields.declare(mesh, {"y", "1", Support::node, 1})) {}
  std::string name() const override { return "decay"; }
  std::string purpose() const override { return "dy/dt = -y"; }
  FieldUse uses() const override { return {{"y"}, {"y"}, {"y"}}; }
  void start() override { std::fill(y_.values().begin(), y_.values().end(), 1.0); }
  Outcome advance(const Increment& increment) override {
    ++calls;
    if (increment.time > fails_after) return Outcome::fail("too late");
    if (increment.dt > largest_dt) return Outcome::retry("step too large");
    for (Real& y : y_.values()) y *= 1 - increment.dt;
    return Outcome::done();
  }

  Real largest_dt = 1e9;
  Real fails_after = 1e9;
  int calls = 0;

 private:
  Field& y_;
};

class DecayProcess : public Process {
 public:
  DecayProcess() : mesh_(test::box_mesh(world(), {})), decay(mesh_, fields_) {}
  const Mesh& mesh() const override { return mesh_; }
  FieldStore& fields() override { return fields_; }
  std::vector<Component*> components() override { return {&decay}; }
  std::vector<LeftOut> left_out() const override { return {{"heat equation", "no [thermal] section"}}; }
  std::vector<std::string> accuracy_settings() const override { return {}; }
  Forecast forecast() const override { return {}; }
  std::vector<std::string> output_fields() const override { return {"y"}; }
  Real largest_step() override { return std::numeric_limits<Real>::infinity(); }
  std::optional<std::string> finished() override { return std::nullopt; }
  std::vector<std::string> history_columns() const override { return {"y"}; }
  std::vector<HistoryCell> history_row() override { return {y()}; }
  Real volume() const override { return 1; }
  std::string increment_note() const override { return ""; }
  /// As if each step took two linear solves of five iterations.
  LinearTotals linear_totals() const override { return {.solves = 2 * decay.calls, .iterations = 10 * decay.calls}; }
  nlohmann::json accuracy() override { return nlohmann::json::object(); }
  nlohmann::json save_state() const override { return {{"calls", decay.calls}}; }
  void restore(Mesh&& mesh, std::vector<SavedField>&& fields, const nlohmann::json& state) override {
    mesh_ = std::move(mesh);
    for (auto& [spec, values] : fields) fields_.declare(mesh_, spec).assign(std::move(values));
    restored_calls = state.at("calls");
  }
  Real y() { return world().max(mesh_.nodes() > 0 ? fields_["y"].values()[0] : -1e300); }

 private:
  Mesh mesh_;
  FieldStore fields_;

 public:
  Decay decay;
  int restored_calls = -1;
};

class EngineRun : public testing::Test {
 protected:
  EngineRun() {
    log::start(world().is_root(), log::Level::quiet);
    settings.program = "test";
    settings.case_name = "decay";
    settings.directory = scratch.path() / "out";
    settings.end = 1;
    settings.step = 0.1;
  }
  ~EngineRun() override { log::close_file(); }
  int run(DecayProcess& process) { return Engine(world(), process, settings).run(); }
  nlohmann::json summary() const {
    world().barrier();
    return nlohmann::json::parse(read_text_file(settings.directory / "summary.json"));
  }
  std::vector<std::string> history() const {
    world().barrier();
    std::ifstream file(settings.directory / "history.csv");
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);) lines.push_back(line);
    return lines;
  }

  ScratchDirectory scratch;
  RunSettings settings;
};

TEST_F(EngineRun, MeetsTheEndInEqualSteps) {
  DecayProcess process;
  EXPECT_EQ(run(process), exit_code::done);
  EXPECT_NEAR(process.y(), std::pow(0.9, 10), 1e-14);
  EXPECT_EQ(history().size(), 11U);
  EXPECT_EQ(summary().at("status"), "done");
  EXPECT_NEAR(summary().at("final").at("time_s").get<Real>(), 1.0, 1e-14);
}

TEST_F(EngineRun, ARowOfTheHistoryHasTheIterationsOfItsIncrement) {
  DecayProcess process;
  run(process);
  EXPECT_EQ(summary().at("final").at("linear_iterations").get<Real>(), 10);
  EXPECT_EQ(summary().at("linear").at("iterations").get<int>(), 100);
}

TEST_F(EngineRun, AStepThatDoesNotDivideTheEndIsShortened) {
  settings.step = 0.3;
  DecayProcess process;
  run(process);
  EXPECT_NEAR(process.y(), std::pow(0.75, 4), 1e-14);
}

TEST_F(EngineRun, CutsTheStepWhereAComponentAsksForIt) {
  DecayProcess process;
  process.decay.largest_dt = 0.03;
  EXPECT_EQ(run(process), exit_code::done);
  EXPECT_NEAR(summary().at("final").at("time_s").get<Real>(), 1.0, 1e-12);
  EXPECT_GT(process.decay.calls, 34);
}

TEST_F(EngineRun, AFailureLeavesTheLastGoodStateAndExitCodeThree) {
  DecayProcess process;
  process.decay.fails_after = 0.55;
  EXPECT_EQ(run(process), exit_code::numerics);
  EXPECT_EQ(summary().at("status"), "failed");
  EXPECT_EQ(summary().at("increments"), 5);
  EXPECT_TRUE(std::filesystem::exists(settings.directory / "decay.xdmf"));
}

TEST_F(EngineRun, GoesOnFromACheckpointAsIfItHadNotStopped) {
  DecayProcess whole;
  run(whole);
  const Real expected = whole.y();
  settings.directory = scratch.path() / "legs";
  settings.more_increments = 4;
  DecayProcess first;
  EXPECT_EQ(run(first), exit_code::done);
  EXPECT_EQ(history().size(), 5U);
  settings.restart = true;
  settings.more_increments.reset();
  DecayProcess second;
  EXPECT_EQ(run(second), exit_code::done);
  EXPECT_EQ(second.y(), expected);
  EXPECT_EQ(second.restored_calls, 4);
  EXPECT_EQ(history().size(), 11U);
}

TEST_F(EngineRun, RestartWithoutACheckpointStartsAnew) {
  settings.restart = true;
  DecayProcess process;
  EXPECT_EQ(run(process), exit_code::done);
  EXPECT_EQ(process.restored_calls, -1);
}

TEST_F(EngineRun, AStopFileLeadsToACheckpointAndExitCode85) {
  class StopsItself : public DecayProcess {
   public:
    explicit StopsItself(std::filesystem::path directory) : directory_(std::move(directory)) {}
    std::string increment_note() const override {
      if (world().is_root()) std::ofstream(directory_ / "stop") << "";
      return "";
    }

   private:
    std::filesystem::path directory_;
  } process(settings.directory);
  EXPECT_EQ(run(process), exit_code::checkpointed);
  EXPECT_EQ(summary().at("increments"), 1);
  settings.restart = true;
  DecayProcess next;
  EXPECT_EQ(run(next), exit_code::done);
  EXPECT_NEAR(next.y(), std::pow(0.9, 10), 1e-14);
}

TEST_F(EngineRun, NothingIsWrittenByACheck) {
  settings.check_only = true;
  DecayProcess process;
  EXPECT_EQ(run(process), exit_code::done);
  EXPECT_EQ(process.decay.calls, 0);
  EXPECT_FALSE(std::filesystem::exists(settings.directory));
}

TEST_F(EngineRun, AFieldThatNothingGivesIsADefect) {
  class ReadsNothing : public Decay {
   public:
    using Decay::Decay;
    FieldUse uses() const override { return {{"temperature"}, {}, {}}; }
  };
  class Wrong : public DecayProcess {
   public:
    std::vector<Component*> components() override { return {&reader}; }
    ReadsNothing reader{mesh(), fields()};
  } process;
  EXPECT_THROW(run(process), Defect);
}

TEST(History, CellsReadBackToTheSameNumber) {
  EXPECT_EQ(history_text(3.0), "3");
  EXPECT_EQ(history_text(std::nullopt), "");
  for (const Real value : {0.1, 1.0 / 3.0, 6.02e23, -1e-300}) EXPECT_EQ(std::stod(history_text(value)), value);
}

}  // namespace
}  // namespace malleus
