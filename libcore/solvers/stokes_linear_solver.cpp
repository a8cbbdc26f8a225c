#include "solvers/stokes_linear_solver.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "base/log.hpp"
#include "solvers/krylov_problem.hpp"
#include "solvers/linear_database.hpp"
#include "solvers/viscosity_range.hpp"

namespace malleus {
namespace {

/// A kept hierarchy is given up where a solve needs this many times the iterations a digit that it needed when new.
constexpr Real growth_allowed = 1.4;
constexpr int fallback_restart = 150;  // with contrast, shorter ones stagnate

using Clock = std::chrono::steady_clock;

Real seconds_since(Clock::time_point start) {
  return std::chrono::duration<Real>(Clock::now() - start).count();
}

/// A step of the chain: a method, its preconditioner's settings, and what the log calls it.
struct Step {
  LinearMethod method;
  PreconditionerSettings settings;
  const char* name;

  bool is_same(const Step& other) const { return method == other.method && settings == other.settings; }
};

/// Stronger and stronger settings, each once. Collective.
std::vector<Step> make_chain(const LinearSolverOptions& options, const LinearSystem& system) {
  PreconditionerSettings first = options.preconditioner;
  first.positive = options.method == LinearMethod::conjugate_residual;
  first = resolve(first, system);
  PreconditionerSettings rigid = first;
  rigid.modes = CoarseModes::rigid;
  PreconditionerSettings rigid_double = rigid;
  rigid_double.precision = CyclePrecision::double_precision;
  PreconditionerSettings gamg = first;
  gamg.velocity = VelocityMethod::gamg;
  const bool asks_for_translations = options.preconditioner.modes == CoarseModes::translations;
  gamg.modes =
      asks_for_translations && options.method == LinearMethod::gamg ? CoarseModes::translations : CoarseModes::rigid;
  std::vector<Step> wished = {
      {options.method, options.method == LinearMethod::gamg ? gamg : first, "the method chosen"}};
  if (options.fall_back && options.method == LinearMethod::block_triangular) {
    wished.push_back({LinearMethod::block_triangular, rigid, "rigid-body modes"});
    wished.push_back({LinearMethod::block_triangular, rigid_double, "rigid-body modes in double precision"});
    wished.push_back({LinearMethod::gamg, gamg, "GAMG with rigid-body modes"});
  }
  if (options.fall_back && system.mesh->total_nodes() <= options.direct_limit) {
    wished.push_back({LinearMethod::direct, first, "the direct solver"});
  }
  std::vector<Step> chain;
  for (const Step& step : wished) {
    const bool is_known = std::any_of(chain.begin(), chain.end(), [&](const Step& s) { return s.is_same(step); });
    if (!is_known) chain.push_back(step);
  }
  return chain;
}

}  // namespace

class StokesLinearSolver::Implementation {
 public:
  explicit Implementation(const LinearSolverOptions& options) : options_(options) {
    register_stokes_preconditioner();
    read_database(options_);
  }

  LinearOutcome solve(const LinearSystem& system, const LinearVector& right_side, Real tolerance,
                      LinearVector& solution) {
    LinearOutcome outcome;
    if (system.pattern_version != pattern_version_) reset();
    pattern_version_ = system.pattern_version;
    const auto start = Clock::now();
    const BorderedOperator op(system);
    KrylovProblem problem(op, right_side, solution);
    if (!std::isfinite(problem.residual()) || !std::isfinite(tolerance)) {
      outcome.reason = "the right side or the matrix is not a number";
      solution = {};
      return outcome;
    }
    const std::vector<Step> chain = make_chain(options_, system);
    first_step_ = std::min(first_step_, chain.size() - 1);
    for (std::size_t s = first_step_; s < chain.size() && !(problem.residual() <= tolerance); ++s) {
      if (s > first_step_) announce_fallback(chain[s], outcome);
      run_step(chain[s], problem, op, tolerance, outcome);
      if (problem.residual() <= tolerance) first_step_ = s;
    }
    outcome.residual = problem.residual();
    outcome.converged = outcome.residual <= tolerance;
    if (outcome.converged) outcome.reason.clear();
    op.extract(problem.solution(), solution);
    outcome.setup_seconds = system.comm->max(outcome.setup_seconds);
    outcome.solve_seconds = system.comm->max(seconds_since(start)) - outcome.setup_seconds;
    return outcome;
  }

  bool needs_symmetry() const { return options_.method == LinearMethod::conjugate_residual; }

  bool is_matrix_free() const { return options_.matrix_free; }

  void reset() {
    setup_.reset();
    first_step_ = 0;
  }

 private:
  struct Setup {
    std::unique_ptr<StokesPreconditioner> preconditioner;
    PreconditionerSettings settings;
    std::uint64_t value_version = 0;
    int borders = 0;
    Real iterations_per_digit = 0;  ///< of the first solve; 0 = none yet
  };

  static void announce_fallback(const Step& step, LinearOutcome& outcome) {
    ++outcome.fallbacks;
    log::warning("linear solver: {} after {} iterations; trying {}", outcome.reason, outcome.iterations, step.name);
  }

  /// Runs a step with the set-up that is kept, for about as long as a new one would take; where that does not do, with
  /// a new one from where the other came.
  void run_step(const Step& step, KrylovProblem& problem, const BorderedOperator& op, Real tolerance,
                LinearOutcome& outcome) {
    const bool keeps =
        options_.reuse_setup && setup_ && setup_->settings == step.settings && setup_->borders == op.borders();
    if (!keeps) setup_.reset();
    const bool is_stale = setup_ && setup_->value_version != op.system().value_version;
    const int most = is_stale ? patience(problem.residual(), tolerance) : options_.max_iterations;
    run_once(step, problem, op, tolerance, most, outcome);
    if (problem.residual() <= tolerance || !is_stale) return;
    setup_.reset();
    run_once(step, problem, op, tolerance, options_.max_iterations, outcome);
  }

  /// Iterations to spend with a set-up that was made for another system.
  int patience(Real residual, Real tolerance) const {
    constexpr int least = 5;
    const Real digits = std::log10(residual / tolerance);
    const Real expected = growth_allowed * setup_->iterations_per_digit * std::max(digits, 0.0);
    return std::min(options_.max_iterations, least + static_cast<int>(expected));
  }

  void run_once(const Step& step, KrylovProblem& problem, const BorderedOperator& op, Real tolerance, int most,
                LinearOutcome& outcome) {
    const Real before = problem.residual();
    LinearSolverOptions options = options_;
    options.max_iterations = most;
    if (outcome.fallbacks > 0) options.restart = std::max(options.restart, fallback_restart);
    const auto provide = [&]() -> StokesPreconditioner& { return provide_preconditioner(step, op, outcome); };
    const KrylovProblem::Run run = problem.run(step.method, tolerance, options, provide);
    outcome.iterations += run.iterations;
    outcome.reason = run.reason;
    judge_setup(run.iterations, before, problem.residual(), op.system().value_version);
  }

  StokesPreconditioner& provide_preconditioner(const Step& step, const BorderedOperator& op, LinearOutcome& outcome) {
    if (!setup_) {
      const auto start = Clock::now();
      setup_.emplace();
      setup_->preconditioner = std::make_unique<StokesPreconditioner>(op, step.settings);
      setup_->settings = step.settings;
      setup_->value_version = op.system().value_version;
      setup_->borders = op.borders();
      outcome.setup_built = true;
      outcome.setup_seconds += seconds_since(start);
      log::debug("linear solver: viscosity contrast {:.2g}: {}", viscosity_range(op.system()).contrast(),
                 setup_->preconditioner->summary());
    }
    setup_->preconditioner->attach(op);
    return *setup_->preconditioner;
  }

  /// Learns what the set-up gives when new; gives it up for the next system when it has aged too far.
  void judge_setup(int iterations, Real before, Real after, std::uint64_t version) {
    if (!setup_ || iterations == 0 || !(after < before)) return;
    const Real rate = iterations / std::max(0.1, std::log10(before / std::max(after, 1e-16)));
    if (setup_->iterations_per_digit <= 0) {
      setup_->iterations_per_digit = rate;
    } else if (setup_->value_version != version && rate > growth_allowed * setup_->iterations_per_digit) {
      setup_.reset();
    }
  }

  LinearSolverOptions options_;
  std::optional<Setup> setup_;
  std::uint64_t pattern_version_ = 0;
  std::size_t first_step_ = 0;  ///< of the chain: where the last system of this pattern was solved
};

StokesLinearSolver::StokesLinearSolver(LinearSolverOptions options)
    : implementation_(std::make_unique<Implementation>(options)) {}
StokesLinearSolver::StokesLinearSolver(StokesLinearSolver&&) noexcept = default;
StokesLinearSolver& StokesLinearSolver::operator=(StokesLinearSolver&&) noexcept = default;
StokesLinearSolver::~StokesLinearSolver() = default;

LinearOutcome StokesLinearSolver::solve(const LinearSystem& system, const LinearVector& right_side, Real tolerance,
                                        LinearVector& solution) {
  return implementation_->solve(system, right_side, tolerance, solution);
}

bool StokesLinearSolver::needs_symmetry() const {
  return implementation_->needs_symmetry();
}

bool StokesLinearSolver::is_matrix_free() const {
  return implementation_->is_matrix_free();
}

void StokesLinearSolver::reset() {
  implementation_->reset();
}

}  // namespace malleus
