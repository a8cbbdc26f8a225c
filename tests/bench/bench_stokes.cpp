/// Measures the Stokes linear solver on lid cavities: iterations, seconds, matrix products, bytes; with m < 1 Newton's
/// method on a cube between platens that stick.
///
/// usage: bench_stokes [name=value]... [-- PETSC OPTIONS]
///   cells=33 (along each axis; 33, 50, 66, 96: 39k, 133k, 301k, 913k nodes)  dim=3  jitter=0.2  tolerance=1e-6
///   m=1 (rate sensitivity)  cut_off=0.01 (over speed / height)  spheres=0 inside=1 (their viscosity; < 1 soft)
///   disjoint=0  open=0

#include <fmt/format.h>

#include <chrono>
#include <ctime>
#include <fstream>
#include <map>
#include <string>

#include "parallel/session.hpp"
#include "solvers/newton.hpp"
#include "solvers/petsc_objects.hpp"
#include "solvers/stokes_linear_solver.hpp"
#include "support/sticking_block.hpp"
#include "support/stokes_cavity.hpp"

namespace malleus {
namespace {

using Clock = std::chrono::steady_clock;

Real seconds_since(Clock::time_point start) {
  return std::chrono::duration<Real>(Clock::now() - start).count();
}

/// A line of /proc/self/status, in bytes.
Real status_bytes(const std::string& name) {
  std::ifstream file("/proc/self/status");
  std::string word;
  Real kibibytes = 0;
  while (file >> word) {
    if (word == name + ":") file >> kibibytes;
  }
  return 1024 * kibibytes;
}

/// Of this process: on a busy machine steadier than the wall's.
Real processor_seconds() {
  return static_cast<Real>(std::clock()) / CLOCKS_PER_SEC;
}

Real seconds_of_product(Mat matrix) {
  constexpr int products = 10;
  PetscVector x, y;
  petsc_call(MatCreateVecs(matrix, x.out(), y.out()));
  petsc_call(VecSet(x.get(), 1.0));
  petsc_call(MatMult(matrix, x.get(), y.get()));
  const Real start = processor_seconds();
  for (int i = 0; i < products; ++i) petsc_call(MatMult(matrix, x.get(), y.get()));
  return (processor_seconds() - start) / products;
}

using Values = std::map<std::string, Real>;

test::BoxMeshOptions box_of(const Values& values) {
  const int cells = static_cast<int>(values.at("cells"));
  return {.dim = static_cast<int>(values.at("dim")), .cells = {cells, cells, cells}, .jitter = values.at("jitter")};
}

int run_nonlinear(const Communicator& comm, const Values& values) {
  test::StickingBlock block(comm, box_of(values), values.at("m"), values.at("cut_off"));
  StokesState state = block.op.start_state();
  StokesLinearSolver linear;
  const NewtonSolver newton({.tolerance = values.at("tolerance"), .start_shear_rate = 1});
  const Real start = processor_seconds();
  const NewtonOutcome outcome = newton.solve(block.op, linear, state);
  const Real processor = comm.max(processor_seconds() - start);
  if (comm.is_root()) {
    fmt::print("nodes {} ranks {} m {} cut-off {:.0e} tolerance {:.0e}: {} {} nonlinear, {} linear iterations\n",
               block.mesh.total_nodes(), comm.size(), values.at("m"), values.at("cut_off"), values.at("tolerance"),
               outcome.converged ? "converged," : "FAILED,", outcome.iterations(), outcome.linear_iterations);
    for (const NewtonIteration& step : outcome.history) {
      fmt::print("  {:>7} residual {:.2e} step {:.3f} linear iterations {:3} to {:.1e}\n",
                 step.newton ? "Newton" : "Picard", step.residual, step.step, step.linear_iterations,
                 step.linear_residual);
    }
    fmt::print("  wall: assembly {:.2f} s, set-up {:.2f} s, solve {:.2f} s; processor {:.2f} s\n",
               outcome.assembly_seconds, outcome.setup_seconds, outcome.solve_seconds, processor);
  }
  return outcome.converged ? 0 : 3;
}

int run_linear(const Communicator& comm, const Values& values) {
  test::CavityOptions options;
  options.box = box_of(values);
  options.spheres = test::spread_spheres(static_cast<int>(values.at("spheres")), values.at("disjoint") > 0);
  options.inside = values.at("inside");
  options.is_open = values.at("open") > 0;
  const auto start = Clock::now();
  const test::StokesCavity cavity(comm, options);
  const Real assembly = seconds_since(start);
  const Real before = comm.sum(status_bytes("VmRSS"));
  const Real product = comm.max(seconds_of_product(cavity.system().matrix));
  const Real solver_start = processor_seconds();
  StokesLinearSolver solver;
  LinearVector solution;
  const LinearOutcome outcome = solver.solve(cavity.system(), cavity.right_side(), values.at("tolerance"), solution);
  const Real processor = comm.max(processor_seconds() - solver_start);
  const Real peak = comm.sum(status_bytes("VmHWM"));
  const auto nodes = static_cast<Real>(cavity.mesh().total_nodes());
  if (comm.is_root()) {
    fmt::print("nodes {} ranks {} inside {:.0e} tolerance {:.0e}: {} {} iterations, residual {:.2e}\n",
               cavity.mesh().total_nodes(), comm.size(), options.inside, values.at("tolerance"),
               outcome.converged ? "converged," : "FAILED,", outcome.iterations, outcome.residual);
    fmt::print("  wall: mesh + assembly {:.2f} s, set-up {:.2f} s, solve {:.2f} s\n", assembly, outcome.setup_seconds,
               outcome.solve_seconds);
    fmt::print("  processor: set-up + solve {:.2f} s = {:.0f} matrix products of {:.2f} ms\n", processor,
               processor / product, 1e3 * product);
    fmt::print("  memory: {:.0f} bytes/node over the assembled system, {:.0f} in all\n", (peak - before) / nodes,
               peak / nodes);
  }
  return outcome.converged ? 0 : 3;
}

}  // namespace
}  // namespace malleus

int main(int argc, char** argv) {
  std::map<std::string, malleus::Real> values = {{"cells", 33},  {"dim", 3},       {"jitter", 0.2}, {"tolerance", 1e-6},
                                                 {"spheres", 0}, {"inside", 1},    {"disjoint", 0}, {"open", 0},
                                                 {"m", 1},       {"cut_off", 0.01}};
  std::vector<std::string> petsc_options;
  bool is_for_petsc = false;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const std::size_t equals = word.find('=');
    if (is_for_petsc) {
      petsc_options.push_back(word);
    } else if (word == "--") {
      is_for_petsc = true;
    } else if (equals == std::string::npos || values.count(word.substr(0, equals)) == 0) {
      fmt::print(stderr, "bench_stokes: unknown argument '{}'\n", word);
      return 2;
    } else {
      values[word.substr(0, equals)] = std::stod(word.substr(equals + 1));
    }
  }
  const malleus::Session session(argc, argv, petsc_options);
  return values.at("m") == 1 ? malleus::run_linear(session.world(), values)
                             : malleus::run_nonlinear(session.world(), values);
}
